// One person at every level of a dose, with what detectors find there and their AP at that level.
"use strict";
hicpExplorers.doses = (place, data, folder) => {
  const picture = hicpMake("div", {class: "hicp-picture"}), words = hicpMake("p", {"aria-live": "polite"});
  let [dose, at, person, minScore] = [data.doses[0], 0, 0, 0.3];

  const draw = () => {
    const view = dose.views[at][person], level = `${dose.name} ${dose.levels[at]}`;
    const alt = `Person ${person + 1} at ${level}, with what is detected`;
    picture.replaceChildren(
      hicpPicture(`${folder}/${view.file}`, view.size, alt, hicpLayers(view, data, legend, minScore)));
    const said = ([value, ...ends]) => value === undefined ? undefined
      : value.toFixed(2) + (ends.includes(null) ? "" : ` [${ends.map(end => end.toFixed(2)).join(", ")}]`);
    for (const {name} of data.detectors) {
      const ap = group => said(hicpNumbers(dose.ap[at], name, group));
      legend.fill(name, [ap("body"), ap("hand"), view.found[name]?.length]);
    }
    words.textContent = `Person ${person + 1} at ${level}.`;
  };
  const levels = hicpMake("div", {class: "hicp-through"});
  const choose = () => {
    at = 0;
    const slider = hicpSlider("Level", dose.levels.length - 1, 0, k => dose.levels[k], k => {
      at = k;
      draw();
    });
    levels.replaceChildren(slider.element);
    draw();
  };
  const legend = hicpLegend(data.detectors, ["AP, bodies", "AP, hands", "found here"], draw);
  const doses = hicpSelect("Dose", data.doses.map(({name}) => [name, name]), dose.name, name => {
    dose = data.doses.find(one => one.name === name);
    choose();
  });
  const people = hicpPick("Person", dose.views[0].map((_, k) => [k, k + 1]), 0, k => {
    person = k;
    draw();
  });
  const score = hicpScore(value => {
    minScore = value;
    draw();
  });
  const side = hicpMake("div", {class: "hicp-controls"}, doses, people.element, legend.element, score.element);
  const note = `AP over ${data.n_people} people at this level, with its 95 % interval where there are enough of them.`;
  place.append(levels, hicpMake("div", {class: "hicp-beside"}, picture, side), words, hicpMake("p", {}, note));
  choose();
};
