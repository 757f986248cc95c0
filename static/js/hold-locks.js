// While something lies over the page, such as the keypad, the page itself locks all holds.
import { find, showAttributes, withheld } from "./show.js";

const TEXTS = ["reason", "reasons", "more"];
let covers = 0; // how many lie over it

/** @param {string | undefined} reason */
export function lockHolds(reason) {
  covers += 1;
  if (covers > 1) return;
  for (const root of document.querySelectorAll("[data-widget]:has(.hold)")) {
    const texts = TEXTS.map((name) => [name, root.querySelector(`[data-text="${name}"]`)?.textContent]);
    const fromServer = { enabled: !find(root, "button.hold").disabled, ...Object.fromEntries(texts) };
    showAttributes(root, { enabled: false, reason, reasons: reason, more: "" });
    withheld.set(root, fromServer);
  }
}

// After the last one the server's lock shows again, as it is by now.
export function unlockHolds() {
  covers -= 1;
  if (covers) return;
  const locks = [...withheld];
  withheld.clear();
  for (const [root, lock] of locks) showAttributes(root, lock);
}
