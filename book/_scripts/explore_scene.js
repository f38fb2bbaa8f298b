// 3D scenes, drawn when they come into view: Plotly takes seconds to load.
"use strict";
const HICP_PLOTLY = new URL("plotly.js", document.currentScript.src).href;
const HICP_TURN_RAD = 0.15;

/** The camera of a scene turned by an angle about the vertical, raised by another, and moved away by a factor. */
function hicpTurned(camera, around, up, away) {
  const {x, y, z} = camera.eye, radius = Math.hypot(x, y, z);
  const [azimuth, height] = [Math.atan2(y, x) + around, Math.asin(z / radius) + up];
  const level = Math.cos(Math.max(-1.5, Math.min(1.5, height)));
  const far = radius * away;
  const eye = {x: far * level * Math.cos(azimuth), y: far * level * Math.sin(azimuth), z: far * Math.sin(Math.max(-1.5, Math.min(1.5, height)))};
  return {...camera, eye};
}

async function hicpDrawScene(place) {
  const [scene] = await Promise.all([hicpLoad(`${place.dataset.folder}/data.js`), hicpLoad(HICP_PLOTLY)]);
  place.replaceChildren();
  await Plotly.newPlot(place, scene.data, scene.layout, scene.config);
  const steps = {
    ArrowLeft: [-HICP_TURN_RAD, 0, 1], ArrowRight: [HICP_TURN_RAD, 0, 1], ArrowUp: [0, HICP_TURN_RAD, 1],
    ArrowDown: [0, -HICP_TURN_RAD, 1], "+": [0, 0, 0.9], "-": [0, 0, 1.1],
  };
  place.addEventListener("keydown", event => {
    if (event.target !== place || !steps[event.key] || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    Plotly.relayout(place, {"scene.camera": hicpTurned(place.layout.scene.camera, ...steps[event.key])});
  });
  // The wheel scrolls the page until the scene has the focus, by a click or the keyboard.
  place.addEventListener("pointerdown", () => place.focus({preventScroll: true}), true);
  place.addEventListener("wheel", event => place.contains(document.activeElement) || event.stopPropagation(), true);
}

addEventListener("DOMContentLoaded", () => {
  const seen = new IntersectionObserver(entries => {
    for (const {isIntersecting, target} of entries) {
      if (!isIntersecting) continue;
      seen.unobserve(target);
      hicpDrawScene(target).catch(error => target.replaceChildren(`The scene cannot be drawn: ${error.message}.`));
    }
  }, {rootMargin: "200px"});
  document.querySelectorAll(".hicp-scene").forEach(scene => seen.observe(scene));
});
