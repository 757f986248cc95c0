// A sequence of steps: each is shown in a place that is there already, and the picture beside them is exchanged.
import { find, setText } from "../show.js";

/** @type {Record<string, Show>} */
export const show = {
  rows: (root, rows) => {
    for (const [place, item] of root.querySelectorAll("li").entries()) showStep(item, rows[place]);
  },
  picture: (root, name) => {
    const frame = root.querySelector("div.picture");
    if (!frame) return;
    const picture = find(frame, "img");
    const address = `${picture.dataset.folder}/${name}`;
    if (name && picture.getAttribute("src") !== address) picture.src = address;
    frame.hidden = !name;
  },
  mark: (root, mark) => {
    const place = root.querySelector("svg.place");
    if (!place) return;
    place.toggleAttribute("hidden", !mark.length);
    for (const [number, name] of ["x", "y"].entries()) place.setAttribute(name, `${mark[number] ?? 0}%`);
  },
  at: (root, number) => {
    const text = root.querySelector("svg.place > text");
    if (text) text.textContent = number;
  },
};

/** @param {HTMLElement} item @param {Data} step */
function showStep(item, step) {
  item.hidden = !step;
  if (!step) return;
  item.dataset.now = step.state;
  if (step.state === "now") item.setAttribute("aria-current", "step");
  else item.removeAttribute("aria-current");
  setText(find(item, "b"), step.number);
  setText(find(item, "span"), step.text);
  setText(find(item, "small"), step.note);
  setText(find(item, "i"), step.word);
}
