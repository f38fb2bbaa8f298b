// People in space, frame by frame: what the camera saw, and bodies (and the robot) to turn.
"use strict";
const HICP_FROM_ABOVE_RAD = 0.25;
const HICP_BODIES = {truth: "#111", paper: "#D55E00", robust: "#0072B2"};

/** A view of space along the horizon, from a bit above: places in mm (x backward, y right, z up) on a screen. */
function hicpView(turn_deg, centre) {
  const [turn, up] = [turn_deg * Math.PI / 180, HICP_FROM_ABOVE_RAD];
  const [c, s, cu, su] = [Math.cos(turn), Math.sin(turn), Math.cos(up), Math.sin(up)];
  return (...place) => {
    const [x, y, z] = place.map((at, k) => at - centre[k]);
    return [c * y - s * x, -(z * cu - (c * x + s * y) * su)];
  };
}

/** Bodies, flat lists of index, x, y, z and score, as they appear in a view, for `hicpPeople`. */
function hicpSeen(bodies, view) {
  return bodies.map(flat => {
    const seen = [];
    for (let k = 0; k < flat.length; k += 5) seen.push(flat[k], ...view(...flat.slice(k + 1, k + 4)), 0.5);
    return seen;
  });
}

/** The robot's parts as thick lines, and threatened taxels as red dots. */
function hicpRobot({robot, taxels}, radii, view) {
  const parts = robot.map((ends, k) => {
    const [[x1, y1], [x2, y2]] = [view(...ends.slice(0, 3)), view(...ends.slice(3))];
    return hicpMake("svg:line", {x1, y1, x2, y2, stroke: "#9aa5b1", "stroke-width": 2 * radii[k], "stroke-linecap": "round"});
  });
  const dots = [];
  for (const flat of taxels)
    for (let k = 0; k < flat.length; k += 5) {
      const [cx, cy] = view(...flat.slice(k + 1, k + 4)), share = Math.min(1, flat[k + 4] / 0.5);
      dots.push(hicpMake("svg:circle", {cx, cy, r: 6 + 14 * share, fill: "#c0392b", "fill-opacity": 0.3 + 0.7 * share}));
    }
  return [...parts, ...dots];
}

hicpExplorers.films = (place, data, folder) => {
  const keys = Object.keys(data.films[0]).filter(key => !["file", "sheet"].includes(key));
  const chosen = {...data.films[0]}, words = hicpMake("p", {"aria-live": "off"});
  const camera = hicpMake("div"), space = hicpMake("div");
  let [film, at, turn_deg, timer] = [null, null, 30, null];

  const frameAt = t_s => film.frames.findLastIndex(frame => frame.t_s <= t_s + 1e-6);
  const firstShown = () => {  // the moment of the first picture with somebody in it, or of the first at all
    const frame = film.frames.find(({found}) => found.length) ?? film.frames[0];
    return Math.max(0, film.steps.findIndex(({t_s}) => t_s >= frame?.t_s));
  };
  const draw = () => {
    const step = film.steps[at], k = frameAt(step.t_s), frame = film.frames[k];
    const style = data.detectors.find(({name}) => name === chosen.detector);
    const colours = {...HICP_BODIES, perceived: style.colour}, view = hicpView(turn_deg, film.centre);
    const [column, row] = [Math.max(k, 0) % data.columns, Math.floor(Math.max(k, 0) / data.columns)];
    const {sheet: {src, naturalWidth, naturalHeight}, width, height} = film;
    const all = {href: src, x: -column * width, y: -row * height, width: naturalWidth, height: naturalHeight};
    const sheet = hicpMake("svg:image", all);
    const alt = `The camera's picture ${k + 1} with what ${chosen.detector} finds`;
    camera.replaceChildren(hicpMake("svg:svg", {viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": alt},
      ...(frame ? [sheet, hicpPeople(frame.found, data.limbs, style, 0.3, 1.2)] : [])));
    const names = ["truth", ...data.bodies].filter(name => frame?.bodies[name] && legend.isShown({name}));
    const drawn = names.map(name => hicpPeople(
      hicpSeen(frame.bodies[name], view), data.limbs, {colour: colours[name], marker: "o"}, 0, film.half / 90, name === "truth" ? "#fff" : "#141414"));
    const box = [-1, -0.75, 2, 1.5].map(share => share * film.half).join(" ");
    space.replaceChildren(hicpMake("svg:svg", {viewBox: box, role: "img", "aria-label": "The same in space"},
      ...hicpScale(film.half), ...(step.robot ? hicpRobot(step, data.radii, view) : []), ...drawn));
    const told = step.robot ? `: nearest ${(100 * step.distance_m).toFixed(1)} cm, activation ${step.activation.toFixed(2)}` : "";
    words.textContent = `${step.t_s.toFixed(1)} s${told}.`;
    time.set(at);
  };
  const stop = () => {
    clearTimeout(timer);
    timer = null;
    play.textContent = "▶ Play";
  };
  const next = () => {
    at = (at + 1) % film.steps.length;
    draw();
    const wait_s = at + 1 < film.steps.length ? film.steps[at + 1].t_s - film.steps[at].t_s : 1;
    const slow = matchMedia("(prefers-reduced-motion: reduce)").matches ? 1 : wait_s;
    timer = place.closest("details").open ? setTimeout(next, 1000 * slow) : stop();
  };
  const play = hicpMake("button", {type: "button", click: () => {
    if (timer) return stop();
    play.textContent = "❚❚ Pause";
    next();
  }}, "▶ Play");
  const open = async (key, value) => {  // the film with this choice that shares most of the others
    stop();
    const agrees = one => keys.filter(other => one[other] === chosen[other]).length;
    const possible = data.films.filter(one => key === undefined || String(one[key]) === value);
    Object.assign(chosen, possible.reduce((best, one) => agrees(one) > agrees(best) ? one : best));
    keys.forEach((other, k) => (choices[k].lastChild.value = chosen[other]));
    film = await hicpLoad(`${folder}/${chosen.file}`);
    film.steps ??= film.frames.map(({t_s}) => ({t_s}));
    film.sheet = hicpMake("img", {src: `${folder}/${chosen.sheet}`});
    await film.sheet.decode();
    film.width = film.sheet.naturalWidth / data.columns;
    film.height = film.sheet.naturalHeight / Math.ceil(film.frames.length / data.columns);
    [film.centre, film.half] = hicpAim(film);
    const {colour} = data.detectors.find(({name}) => name === chosen.detector);
    if (data.bodies.includes("perceived")) legend.paint("perceived", colour);
    at = Math.min(at ?? firstShown(), film.steps.length - 1);
    time.input.max = film.steps.length - 1;
    draw();
  };
  const choices = keys.map(key => {
    const values = [...new Set(data.films.map(one => one[key]))];
    const title = key[0].toUpperCase() + key.slice(1);
    return hicpSelect(title, values.map(value => [value, value]), chosen[key], value => open(key, value));
  });
  const time = hicpSlider("Time", 1, 0, k => film ? `${film.steps[k].t_s.toFixed(1)} s` : "", k => {
    stop();
    at = k;
    draw();
  });
  const turn = hicpSlider("Turn", 360, turn_deg, k => `${k}°`, k => {
    turn_deg = k;
    draw();
  });
  const legend = hicpLegend(data.bodies.map(name => ({name, colour: HICP_BODIES[name] ?? "#888", marker: "o"})), [], () => draw());
  const left = hicpMake("div", {class: "hicp-picture"}, camera, words, legend.element);
  const right = hicpMake("div", {class: "hicp-picture"}, space, turn.element);
  place.append(
    hicpMake("div", {class: "hicp-through"}, ...choices), hicpMake("div", {class: "hicp-through"}, play, time.element),
    hicpMake("div", {class: "hicp-beside"}, left, right));
  open();
};

/** Where a film is looked at, and half the width of the view, in mm: on the true body, if it is known, and the robot. */
function hicpAim(film) {
  const places = film.steps.flatMap(({robot}) => (robot ?? []).map(ends => ends.slice(0, 3)));
  for (const {bodies} of film.frames)
    for (const flat of bodies.truth ?? Object.values(bodies).flat())
      for (let k = 0; k < flat.length; k += 5) places.push(flat.slice(k + 1, k + 4));
  const ranges = [0, 1, 2].map(axis => {  // some lifted points lie on the wall
    const sorted = places.map(place => place[axis]).sort((a, b) => a - b), n = sorted.length - 1;
    return n < 0 ? [-500, 500] : [sorted[Math.floor(0.02 * n)], sorted[Math.ceil(0.98 * n)]];
  });
  const [width, depth, height] = ranges.map(([low, high]) => (high - low) / 2), level = Math.hypot(width, depth);
  return [ranges.map(([low, high]) => (low + high) / 2), 1.1 * Math.max(level, 4 / 3 * (height + level * HICP_FROM_ABOVE_RAD))];
}

/** A line of 20 cm in the lower left corner of a view. */
function hicpScale(half) {
  const [x, y] = [-0.95 * half, 0.7 * half], size = half / 16;
  return [hicpMake("svg:path", {d: `M${x} ${y}h200`, stroke: "currentColor", "stroke-width": size / 6}),
    hicpMake("svg:text", {x, y: y - size / 2, "font-size": size, fill: "currentColor"}, "20 cm")];
}
