// What pages do beyond the theme's: unfold code, enlarge figures, scroll wide tables by keyboard.
// Each works without: folds open one by one, figures lead to their files.
document.addEventListener("DOMContentLoaded", () => {
  const folds = document.querySelectorAll("details.hicp-code");
  if (folds.length) {
    const button = document.createElement("button");
    const show = (isShown) => {
      folds.forEach((fold) => { fold.open = isShown; });
      button.textContent = isShown ? "Hide code" : "Show code";
    };
    button.className = "hicp-show-code";
    button.addEventListener("click", () => {
      const isShown = localStorage.getItem("hicp-code") !== "shown";
      localStorage.setItem("hicp-code", isShown ? "shown" : "hidden");
      show(isShown);
    });
    document.querySelector("article h1").after(button);
    show(localStorage.getItem("hicp-code") === "shown");
  }

  const box = document.createElement("dialog");
  box.className = "hicp-enlarged";
  box.addEventListener("click", () => box.close());
  document.addEventListener("click", (event) => {
    const link = event.target.closest("a.hicp-zoom");
    if (!link || event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    const image = link.firstElementChild.cloneNode();
    box.replaceChildren(image);
    box.setAttribute("aria-label", image.alt);
    if (!box.isConnected) document.body.append(box);
    box.showModal();
  });

  // Only what is wider than its place takes part in the order of the Tab key; tables are told by their caption.
  const measure = new ResizeObserver((entries) => entries.forEach(({ target }) => {
    const caption = target.querySelector("caption");
    const isWider = target.scrollWidth > target.clientWidth;
    target.classList.toggle("hicp-wider", isWider);
    const names = { tabindex: 0, ...(caption && { role: "region", "aria-label": `${caption.textContent} (scrolls)` }) };
    Object.entries(names).forEach(([name, value]) => {
      if (isWider) target.setAttribute(name, value);
      else target.removeAttribute(name);
    });
  }));
  document.querySelectorAll(".hicp-table, .pst-scrollable-table-container, pre, .hicp-formula")
    .forEach((part) => measure.observe(part));
});
