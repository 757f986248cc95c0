// The groups of a page that fits, one at a time where they have no room side by side.
const groups = document.querySelectorAll("[data-group]");
const tabs = document.querySelectorAll(".group-tab");

/** @param {string | undefined} number */
function show(number) {
  for (const group of groups) group.classList.toggle("shown", group.dataset.group === number);
  for (const tab of tabs) tab.setAttribute("aria-pressed", String(tab.dataset.shows === number));
}

for (const tab of tabs) tab.addEventListener("click", () => show(tab.dataset.shows));
