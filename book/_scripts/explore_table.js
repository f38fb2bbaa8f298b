// Tables that ask for it: sorted by a column, and filtered by text; several together also by which one.
"use strict";

/** What a cell is sorted by: its number where it begins with one, else its text; dashes come last. */
function hicpOrder(cell) {
  const text = cell.textContent.trim().replace(/^[−-](?=[\d.])/, "-");
  return [text === "–" ? 1 : 0, parseFloat(text), text];
}

function hicpCompare(a, b) {
  if (a[0] !== b[0]) return a[0] - b[0];
  return a[1] - b[1] || a[2].localeCompare(b[2], "en", {numeric: true});
}

/** Make each heading of a table a button that sorts by its column, the other way round when pressed again. */
function hicpSortable(table) {
  const heads = [...table.tHead.rows[0].cells], body = table.tBodies[0];
  heads.forEach((head, column) => {
    const sort = () => {
      const up = head.getAttribute("aria-sort") !== "ascending";
      heads.forEach(other => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      const rows = [...body.rows].map(row => [hicpOrder(row.cells[column]), row]);
      rows.sort(([a], [b]) => (up || a[0] !== b[0] ? 1 : -1) * hicpCompare(a, b));
      body.append(...rows.map(([, row]) => row));
    };
    const button = hicpMake("button", {type: "button", class: "hicp-sort", click: sort});
    button.append(...head.childNodes);
    head.append(button);
  });
}

/** A bar that filters tables by a text in their rows, and by which of them are shown. */
function hicpFilter(tables) {
  const figures = tables.map(table => table.closest("figure")), shown = new Set(figures);
  const count = hicpMake("output"), text = hicpMake("input", {type: "search", input: () => update()});
  const rows = tables.flatMap(table => [...table.tBodies[0].rows]);
  const update = () => {
    const words = text.value.toLowerCase().split(/\s+/).filter(Boolean);
    for (const row of rows) {
      const said = row.textContent.toLowerCase();
      row.hidden = !words.every(word => said.includes(word));
    }
    figures.forEach((figure, k) => {
      figure.hidden = !shown.has(figure) || (words.length && ![...tables[k].tBodies[0].rows].some(row => !row.hidden));
    });
    const left = rows.filter(row => !row.hidden && !row.closest("figure").hidden).length;
    count.value = `${left} of ${rows.length} rows`;
  };
  const boxes = figures.map(figure => hicpMake("label", {}, hicpMake("input", {
    type: "checkbox", checked: true,
    change: event => (shown[event.target.checked ? "add" : "delete"](figure), update()),
  }), ` ${figure.id.replaceAll("_", " ")}`));
  const bar = hicpMake("div", {class: "hicp-explorer hicp-filter", role: "search", "aria-label": `Rows of ${figures.map(figure => figure.id.replaceAll("_", " ")).join(", ")}`},
    hicpMake("label", {}, "Rows with ", text), ...(boxes.length > 1 ? boxes : []), count);
  figures[0].before(bar);
  update();
}

addEventListener("DOMContentLoaded", () => {
  const groups = new Map();
  for (const table of document.querySelectorAll('[data-explorer="table"] table')) {
    hicpSortable(table);
    const group = table.closest(".cell") ?? table;
    groups.set(group, [...(groups.get(group) ?? []), table]);
  }
  groups.forEach(hicpFilter);
});
