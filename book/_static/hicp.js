// What pages do beyond the theme's: show code, enlarge figures, scroll wide tables by keyboard.
const showCode = (isShown) => {
  document.documentElement.classList.toggle("hicp-code", isShown);
  document.querySelectorAll(".hicp-show-code").forEach((button) => { button.textContent = isShown ? "Hide code" : "Show code"; });
  document.querySelectorAll("details.hide").forEach((fold) => { fold.open = true; });
};
const isCodeShown = () => localStorage.getItem("hicp-code") === "shown";
showCode(isCodeShown()); // before anything is drawn

document.addEventListener("DOMContentLoaded", () => {
  if (document.querySelector(".cell_input")) {
    const button = document.createElement("button");
    button.className = "hicp-show-code";
    button.addEventListener("click", () => {
      localStorage.setItem("hicp-code", isCodeShown() ? "hidden" : "shown");
      showCode(isCodeShown());
    });
    document.querySelector("article h1").after(button);
    showCode(isCodeShown());
  }

  const box = document.createElement("dialog");
  box.className = "hicp-enlarged";
  const close = document.createElement("button");
  close.textContent = "Close";
  box.addEventListener("click", () => box.close());
  document.addEventListener("click", (event) => {
    const link = event.target.closest("a.hicp-zoom");
    if (!link || event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    const image = link.firstElementChild.cloneNode();
    box.replaceChildren(close, image);
    box.setAttribute("aria-label", image.alt);
    if (!box.isConnected) document.body.append(box);
    box.showModal();
  });

  // Only what is wider than its place takes part in the order of the Tab key; tables are told by their caption.
  const tables = [...document.querySelectorAll(".hicp-table, .pst-scrollable-table-container")];
  const measure = new ResizeObserver((entries) => entries.forEach(({ target }) => {
    const caption = target.querySelector("caption");
    const isWider = target.scrollWidth > target.clientWidth;
    target.classList.toggle("hicp-wider", isWider);
    const names = target.href ? {} : { tabindex: 0 };  // a link has its turn anyway
    if (caption) {
      names.role = "region";
      names["aria-label"] = `Table ${tables.indexOf(target) + 1}, scrolls: ${caption.textContent}`;
    }
    Object.entries(names).forEach(([name, value]) => {
      if (isWider) target.setAttribute(name, value);
      else target.removeAttribute(name);
    });
  }));
  [...tables, ...document.querySelectorAll("pre, .hicp-formula, .hicp-chart")].forEach((part) => measure.observe(part));
});
