"use strict";
// The page's parts that move: the theme, the table that picks the object, thumbnails.

document.getElementById("theme").addEventListener("click", () => {
  const dark = document.documentElement.dataset.theme
    ? document.documentElement.dataset.theme === "dark"
    : window.matchMedia("(prefers-color-scheme: dark)").matches;
  document.documentElement.dataset.theme = dark ? "light" : "dark";
});

async function start() {
  const objects = JSON.parse(document.getElementById("objects-data").textContent), element = document.getElementById("panel");
  try {
    const panel = new Panel(element, objects);
    const pick = async (name) => {
      await panel.show(name);
      for (const row of document.querySelectorAll("#objects-table tr[data-object]"))
        if (row.dataset.object === name) row.setAttribute("aria-current", "true");
        else row.removeAttribute("aria-current");
    };
    for (const button of document.querySelectorAll("[data-show]"))
      button.addEventListener("click", async () => {
        await pick(button.dataset.show);
        element.scrollIntoView({ block: "nearest" });
      });
    await pick(document.querySelector("[data-show]").dataset.show);
    await drawThumbnails(objects, (name) => document.querySelector(`[data-thumb="${name}"]`));
    document.body.dataset.ready = "yes";
  } catch (error) { sorry(element, error); }
}
start();
