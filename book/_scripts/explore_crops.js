// Any person of the data set, as every detector sees them.
"use strict";
hicpExplorers.crops = (place, data, folder) => {
  const picture = hicpMake("div", {class: "hicp-picture"}), words = hicpMake("p", {"aria-live": "polite"});
  const offered = data.subsets.filter(name => data.people.some(({views}) => views[name]));
  let [at, subset, minScore, order] = [0, offered[0], 0.3, ""], people;

  const draw = () => {
    const {id, views} = people[at], view = views[subset];
    const finders = data.detectors.filter(({name}) => view.found[name]?.length).map(({name}) => name);
    const alt = `A person in ${subset}, found by ${finders.join(", ") || "nobody"}`;
    picture.replaceChildren(
      hicpPicture(`${folder}/${view.file}`, view.size, alt, hicpLayers(view, data, legend, minScore)));
    for (const {name} of data.detectors) {
      const oks = group => hicpNumbers(view.oks, name, group)[0]?.toFixed(2);
      legend.fill(name, [oks("body"), oks("hand"), view.found[name]?.length]);
    }
    words.textContent = `Crop ${id} of ${subset}.`;
  };
  const go = to => {
    at = Math.max(0, Math.min(people.length - 1, to));
    slider.set(at);
    draw();
  };
  const fit = ({views}) => ["body", "hand"].flatMap(group => hicpNumbers(views[subset].oks, order, group))[0] ?? 2;
  const choose = () => {  // whom to go through, from the same person on if possible
    const shown = people?.[at];
    people = data.people.filter(({views}) => views[subset]);
    if (order) people.sort((a, b) => fit(a) - fit(b));
    slider.input.max = people.length - 1;
    go(people.indexOf(shown));
  };
  const step = (label, by, sign) =>
    hicpMake("button", {type: "button", "aria-label": `${label} person`, click: () => go(at + by)}, sign);

  const slider = hicpSlider("Person", data.people.length - 1, 0, k => `${k + 1} of ${(people ?? data.people).length}`, go);
  const legend = hicpLegend(data.detectors, ["OKS, body", "OKS, hands", "found"], draw);
  const titles = offered.map(name => [name, name[0].toUpperCase() + name.slice(1)]);
  const subsets = hicpPick("Data set", titles, subset, name => {
    subset = name;
    choose();
  });
  const score = hicpScore(value => {
    minScore = value;
    draw();
  });
  const orders = data.detectors.map(({name}) => [name, `worst of ${name} first`]);
  const sorting = hicpSelect("Order", [["", "as in the data set"], ...orders], "", name => {
    [order, at] = [name, -1];
    choose();
  });
  const through = hicpMake("div", {class: "hicp-through"}, step("Previous", -1, "◀"), slider.element, step("Next", 1, "▶"));
  const side = hicpMake("div", {class: "hicp-controls"}, subsets.element, legend.element, score.element, sorting);
  const note = "OKS counts every keypoint, whatever its score. Hollow: true places that are hidden from view.";
  place.append(through, hicpMake("div", {class: "hicp-beside"}, picture, side), words, hicpMake("p", {}, note));
  choose();
};
