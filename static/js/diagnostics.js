// The page of diagnostics: fetched again while it is seen, and put into the page that is there: texts and
// attributes, in place. Nothing is asked for while the last answer is still awaited.
import { updateInPlace } from "./in-place.js";
import { closest, find } from "./show.js";

const CONTENT_MS = 2000;
const LOOK_MS = 500;
const LONGEST_MS = 10_000; // for an answer

const main = find(document, "main[data-poll]");
let isTouched = false; // under a finger nothing changes
let roundTripMs = 0;

poll(CONTENT_MS, async () => {
  const rtt = roundTripMs ? `&rtt=${roundTripMs.toFixed(1)}` : "";
  const began = performance.now();
  const fresh = await fetched(`${main.dataset.poll}&part=content${rtt}${isPaused() ? "&paused=true" : ""}`);
  roundTripMs = performance.now() - began;
  if (fresh && !isTouched) update(main, fresh);
});
poll(LOOK_MS, async () => {
  const messages = main.querySelector("[data-look]");
  const pause = main.querySelector("button.pause");
  if (pause) pause.hidden = false;
  if (!messages || isPaused()) return;
  const fresh = await fetched(messages.dataset.look ?? "");
  if (fresh && messages.isConnected) update(messages, fresh);
});

main.addEventListener("pointerdown", () => (isTouched = true));
for (const name of ["pointerup", "pointercancel"]) addEventListener(name, () => (isTouched = false));
main.addEventListener("click", ({ target }) => {
  const pause = closest(target, "button.pause");
  if (pause) pause.setAttribute("aria-pressed", String(pause.getAttribute("aria-pressed") !== "true"));
});

function isPaused() {
  return main.querySelector("button.pause")?.getAttribute("aria-pressed") === "true";
}

// Each time after the answer, so that a slow server is asked less often.
/** @param {number} everyMs @param {() => Promise<void>} work */
async function poll(everyMs, work) {
  for (;;) {
    await new Promise((resolve) => setTimeout(resolve, everyMs));
    if (!document.hidden) await work().catch(() => {}); // the page itself shows that the server is lost
  }
}

/** @param {string} address @returns {Promise<Element | null>} */
async function fetched(address) {
  const answer = await fetch(address, {
    headers: { accept: "text/html" },
    signal: AbortSignal.timeout(LONGEST_MS),
  });
  if (!answer.ok) return null;
  return new DOMParser().parseFromString(`<div>${await answer.text()}</div>`, "text/html").body.firstElementChild;
}

// What the page has set itself stays: what is typed, the pause, and its messages, which are newer. A look that is
// paused is in no answer.
/** @param {Element} old @param {Element} fresh */
function update(old, fresh) {
  updateInPlace(old, fresh, {
    skips: (element) => element.matches("input, button.pause"),
    stays: (element) => isPaused() && element.matches(".look"),
  });
}
