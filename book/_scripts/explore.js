// Parts of a page that its reader explores. Each is made when it is opened, from data that lie beside the
// results as a script, since a page that is read from disk may not fetch other files.
"use strict";
const hicpExplorers = {};  // by kind: (place, data, folder) => builds the explorer
const hicpLoading = {};

/** Called by a script of data. */
function hicpData(data) {
  hicpLoading[document.currentScript.src].resolve(data);
}

/** What the script at an address hands to `hicpData`, loaded once; of any other script nothing. */
function hicpLoad(address) {
  const url = new URL(address, document.baseURI).href;
  hicpLoading[url] ??= (() => {
    const entry = {}, script = document.createElement("script");
    entry.done = new Promise((resolve, reject) => {
      entry.resolve = resolve;
      script.onload = () => resolve();
      script.onerror = () => reject(new Error(`${address} could not be read`));
    });
    script.src = url;
    document.head.append(script);
    return entry;
  })();
  return hicpLoading[url].done;
}

/** An element of HTML, or of SVG after "svg:", with attributes (functions listen) and children. */
function hicpMake(tag, attributes = {}, ...children) {
  const [, space, name] = /^(svg:)?(.*)$/.exec(tag);
  const element = space
    ? document.createElementNS("http://www.w3.org/2000/svg", name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(key, value);
    else if (value !== false) element.setAttribute(key, value === true ? "" : value);
  }
  element.append(...children);
  return element;
}

/** A labelled `<select>`; `options` are [value, text]. */
function hicpSelect(label, options, chosen, change) {
  const items = options.map(([value, text]) => hicpMake("option", {value, selected: value === chosen}, text));
  const select = hicpMake("select", {change: () => change(select.value)}, ...items);
  return hicpMake("label", {}, `${label} `, select);
}

/** A labelled slider of whole numbers; `say` puts its value into words. */
function hicpSlider(label, last, at, say, change) {
  const words = hicpMake("output"), input = hicpMake("input", {type: "range", min: 0, max: last, value: at});
  const show = () => {
    words.value = say(+input.value);
    input.setAttribute("aria-valuetext", words.value);
  };
  input.addEventListener("input", () => (show(), change(+input.value)));
  show();
  const element = hicpMake("label", {class: "hicp-slider"}, `${label} `, input, " ", words);
  return {element, input, set: value => (input.value = value, show())};
}

const HICP_MARKS = {
  s: "M-1-1H1V1H-1Z", D: "M0-1.4 1.4 0 0 1.4-1.4 0Z", "^": "M0-1.3 1.2 1H-1.2Z", v: "M0 1.3-1.2-1H1.2Z",
  X: "M-1.2-.7-.7-1.2 0-.5.7-1.2 1.2-.7.5 0 1.2.7.7 1.2 0 .5-.7 1.2-1.2.7-.5 0Z",
  P: "M-.4-1.2H.4V-.4H1.2V.4H.4V1.2H-.4V.4H-1.2V-.4H-.4Z",
  o: "M-1 0A1 1 0 1 1 1 0A1 1 0 1 1-1 0Z",
};

/** People, each a flat list of index, u, v and score, as lines and marks: a group of SVG. */
function hicpPeople(people, limbs, {colour, marker}, minScore, unit, rim = "#141414") {
  const lines = {body: "", hand: ""}, marks = [];
  for (const flat of people) {
    const points = {};
    for (let k = 0; k < flat.length; k += 4)
      if (flat[k + 3] >= minScore) points[flat[k]] = flat.slice(k + 1, k + 4);
    for (const [a, b] of limbs)
      if (points[a] && points[b])
        lines[a < 94 ? "body" : "hand"] += `M${points[a][0]} ${points[a][1]}L${points[b][0]} ${points[b][1]}`;
    for (const [index, [u, v, score]] of Object.entries(points)) {
      const size = unit * (index < 26 ? 1.6 : 0.6);
      const fill = rim === "#fff" && score === 1 ? "#fff" : colour;  // the truth that is hidden from view
      const d = HICP_MARKS[index < 26 ? marker : "o"] ?? HICP_MARKS.o;
      const place = `translate(${u} ${v})scale(${size})`;
      marks.push(hicpMake("svg:path", {d, fill, stroke: fill === colour ? rim : colour, transform: place}));
    }
  }
  const pen = (stroke, width, d) => hicpMake("svg:path", {d, stroke, "stroke-width": width, fill: "none"});
  const under = [pen(rim, unit * 2, lines.body), pen(rim, unit * 1.3, lines.hand)];
  const over = [pen(colour, unit, lines.body), pen(colour, unit * 0.6, lines.hand)];
  return hicpMake("svg:g", {class: "hicp-people"}, ...under, ...over, ...marks);
}

/** A picture with people on it, as SVG; `layers` are groups from `hicpPeople`. */
function hicpPicture(address, [width, height], words, layers) {
  const image = hicpMake("svg:image", {href: address, width, height});
  const frame = {viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": words};
  return hicpMake("svg:svg", frame, image, ...layers);
}

const HICP_TRUTH = {name: "truth", colour: "#111", marker: "o"};

/** A table with a row for each detector and the truth, to switch them off; `heads` name its further columns. */
function hicpLegend(styles, heads, change) {
  const hidden = new Set(), rows = {};
  for (const {name, colour, marker} of [...styles, HICP_TRUTH]) {
    const box = hicpMake("input", {type: "checkbox", checked: true, change: () => {
      hidden[box.checked ? "delete" : "add"](name);
      change();
    }});
    const mark = hicpMake("svg:path", {
      d: HICP_MARKS[marker] ?? HICP_MARKS.o, fill: colour, stroke: name === "truth" ? "#fff" : "#141414",
    });
    const swatch = hicpMake("svg:svg", {viewBox: "-2 -2 4 4", class: "hicp-swatch", "aria-hidden": "true"}, mark);
    const pieces = name.split(/(?<=[:+])/).flatMap(piece => [piece, hicpMake("wbr")]);
    const label = hicpMake("label", {}, box, " ", swatch, " ", ...pieces);
    const cells = heads.map(() => hicpMake("td", {}, name === "truth" ? "" : "–"));
    rows[name] = hicpMake("tr", {}, hicpMake("th", {scope: "row"}, label), ...cells);
  }
  const columns = ["shown", ...heads].map(text => hicpMake("th", {scope: "col"}, text));
  const head = hicpMake("thead", {}, hicpMake("tr", {}, ...columns));
  const element = hicpMake("table", {}, head, hicpMake("tbody", {}, ...Object.values(rows)));
  const fill = (name, texts) => texts.forEach((text, k) => (rows[name].cells[k + 1].textContent = text ?? "–"));
  const paint = (name, colour) => rows[name].querySelector("path").setAttribute("fill", colour);
  return {element, fill, paint, isShown: ({name}) => !hidden.has(name)};
}

/** The numbers of a detector and group, of rows that begin with these two; none where there is no such row. */
function hicpNumbers(rows, detector, group) {
  return rows.find(row => row[0] === detector && row[1] === group)?.slice(2) ?? [];
}

/** What of a picture is shown: the truth below, then detectors' people. */
function hicpLayers(view, data, legend, minScore) {
  const unit = Math.hypot(...view.size) / 230, shown = data.detectors.filter(legend.isShown);
  const layers = shown.map(style => hicpPeople(view.found[style.name] ?? [], data.limbs, style, minScore, unit));
  const truth = hicpPeople(view.truth, data.limbs, HICP_TRUTH, 1, unit, "#fff");
  return legend.isShown(HICP_TRUTH) ? [truth, ...layers] : layers;
}

/** A slider of the score from which keypoints are drawn; `change` takes it. */
function hicpScore(change) {
  return hicpSlider("Keypoints from a score of", 100, 30, k => (k / 100).toFixed(2), k => change(k / 100));
}

/** Radio buttons; `options` are [value, text]; in `pick.inputs` by value. */
function hicpPick(title, options, chosen, change) {
  const name = `hicp-${title}`, inputs = {};
  const labels = options.map(([value, text]) => {
    inputs[value] = hicpMake("input", {type: "radio", name, checked: value === chosen, change: () => change(value)});
    return hicpMake("label", {}, inputs[value], ` ${text}`);
  });
  return {element: hicpMake("fieldset", {}, hicpMake("legend", {}, title), ...labels), inputs};
}

addEventListener("DOMContentLoaded", () => {
  for (const place of document.querySelectorAll(".hicp-explorer")) {
    const {explorer, folder, title} = place.dataset, inside = hicpMake("div", {"aria-live": "off"});
    const open = async () => {
      if (!details.open || inside.hasChildNodes()) return;
      inside.append("Loading …");
      try {
        const data = await hicpLoad(`${folder}/data.js`);
        inside.replaceChildren();
        hicpExplorers[explorer](inside, data, folder);
      } catch (error) {
        inside.replaceChildren(`This cannot be explored: ${error.message}.`);
      }
    };
    const details = hicpMake("details", {toggle: open}, hicpMake("summary", {}, title), inside);
    place.append(details);
  }
});
