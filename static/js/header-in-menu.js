// What the header has no room for is in the menu, and follows the header there.
import { find, setText } from "./show.js";

const header = find(document, "header");

function renew() {
  for (const copy of document.querySelectorAll(".menu [data-of]"))
    setText(copy, header.querySelector(copy.dataset.of ?? "")?.textContent ?? "");
}

new MutationObserver(renew).observe(header, { subtree: true, childList: true, characterData: true });
renew();
