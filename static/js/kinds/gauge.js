import { find, setText } from "../show.js";

// Moves what stands on the scale of a gauge.
/** @type {Record<string, Show>} */
export const show = {
  text: (root, text) => {
    setText(find(root, '[data-text="text"]'), text);
    const now = root.querySelector(".pointer > .now");
    if (now) now.textContent = text;
  },
  pointer: (root, value) => place(root, ".pointer", value),
  setpoint: (root, value) => place(root, ".setpoint", value),
};

// `percent` is from the lower end of the scale, null where it is unknown.
/** @param {HTMLElement} root @param {string} mark @param {number | null} percent */
function place(root, mark, percent) {
  const element = find(root, mark);
  element.toggleAttribute("hidden", percent === null);
  if (percent === null) return;
  if (root.classList.contains("vertical")) element.setAttribute("y", `${100 - percent}%`);
  else element.setAttribute("x", `${percent}%`);
}
