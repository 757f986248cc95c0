// The events that end a hold.

// Calls `end(why)`. `pointer` and `key` return the pointer id and the key that hold the button, or null.
/** @param {HTMLButtonElement} button @param {() => number | null} pointer @param {() => string | null} key @param {(why: string) => void} end */
export function listenForEnd(button, pointer, key, end) {
  const on = (target, name, listener) => target.addEventListener(name, listener, { capture: true });
  button.addEventListener("pointerleave", (event) => event.pointerId === pointer() && end("sliding"));
  button.addEventListener("contextmenu", (event) => {
    event.preventDefault();
    end("menu");
  });
  button.addEventListener("blur", () => end("blur"));
  on(window, "pointerdown", (event) => event.pointerId !== pointer() && end("second"));
  on(window, "pointerup", (event) => event.pointerId === pointer() && end("released"));
  on(window, "pointercancel", (event) => event.pointerId === pointer() && end("cancel"));
  on(window, "keyup", (event) => event.key === key() && end("released"));
  on(window, "keydown", (event) => event.key === "Escape" && end("escape"));
  on(window, "blur", (event) => event.target === window && end("blur"));
  on(document, "visibilitychange", () => document.hidden && end("hiding"));
  on(window, "pagehide", () => end("leaving"));
  // A lock, or the loss of the event stream, which locks all.
  new MutationObserver(() => button.disabled && end("lock")).observe(button, { attributeFilter: ["disabled"] });
}
