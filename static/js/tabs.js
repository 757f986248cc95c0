// The groups of a page that fits, one at a time where they have no room side by side.
const groups = document.querySelectorAll("[data-group]");
const tabs = document.querySelectorAll(".group-tab");

/** @param {string | undefined} number */
function show(number) {
  for (const group of groups) group.classList.toggle("shown", group.dataset.group === number);
  for (const tab of tabs) tab.setAttribute("aria-pressed", String(tab.dataset.shows === number));
}

for (const tab of tabs) tab.addEventListener("click", () => show(tab.dataset.shows));

// An address that names a widget shows its group.
function showNamed() {
  const group = document.getElementById(location.hash.slice(1))?.closest("[data-group]");
  if (group instanceof HTMLElement && tabs.length) show(group.dataset.group);
}

addEventListener("hashchange", showNamed);
showNamed();
