// A press: sent once on release, with an id. Its receipt is shown at the pressed widget.
import { enteredValues, forgetRobotValue } from "./entries.js";
import { closest, find, hooksOf, isEquipped, needsPerson, showReceipt } from "./show.js";
import { feelTouches, StopKeys } from "./touches.js";

const RESPONSE_TIMEOUT_MS = 5000;
// A second tap within this time is the same press.
export const TAP_AGAIN_MS = 700;
// The socket of a page that is not touched for so long is closed.
const UNTOUCHED_MS = 60_000;
/** @param {Response} response */
const read = async (response) => ({ ...(await response.json()), status: response.status });

// Posts JSON; given up after a time, by a timer, as some browsers have no `AbortSignal.timeout`.
/** @param {string} url @param {object} body @param {number} timeoutMs @param {RequestInit} [options] */
export function post(url, body, timeoutMs, options) {
  const request = new AbortController();
  setTimeout(() => request.abort(), timeoutMs);
  return fetch(url, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
    signal: request.signal,
    ...options,
  });
}

export function newId() {
  return Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
}

// The robots that a press stops, where its button is for several.
/** @param {string} url */
function robotsOf(url) {
  const robots = new URL(url, location.href).searchParams.get("robots");
  return robots ? { robots } : {};
}

// Asks before a press. `answered` gets the event of the "yes", and of a press that a person confirms the confirmation.
/** @typedef {(root: HTMLElement, answered: (yes: Event, proof?: { confirmation: string }) => void, button: HTMLButtonElement, inputs: Record<string, Data>) => void} Ask */

/** @param {HTMLElement} root whether there is a question before its presses: its script comes at a touch */
const asks = (root) => root.querySelector("dialog.ask") !== null || needsPerson(root);

export class Presser {
  /** @type {import("./press-socket.js").PressSocket | null} */
  #socket = null;
  #untouchedTimer = 0;
  /** @type {Map<string, HTMLElement>} */
  #widgets;
  /** @type {PageSource} */
  #source;
  /** @type {(root: HTMLElement) => Promise<Ask>} */
  #loadAsk;
  /** @type {Set<string>} */
  #pending = new Set(); // URLs of presses without a response yet
  /** @type {HTMLButtonElement | null} */
  #downButton = null; // the enabled button under the pointer when it went down
  #downValue = ""; // of that button then: the goal that it cancels, or the value that it sends
  /** @type {string | null} */
  #seen = null;
  #id = newId(); // of the next press
  /** @type {Map<HTMLElement | null, HTMLElement>} */
  #buttons = new Map(); // submit button → its widget
  #stops = new StopKeys((button, event) => this.#pressed(event, button));

  // `loadAsk` brings the script of the question before a press of this widget.
  /** @param {Map<string, HTMLElement>} widgets @param {PageSource} source @param {(root: HTMLElement) => Promise<Ask>} loadAsk */
  constructor(widgets, source, loadAsk) {
    this.#loadAsk = loadAsk;
    this.#widgets = widgets;
    this.#source = source;
    addEventListener("pointerdown", ({ target }) => this.#down(target), true);
    feelTouches();
    // A key that is held down is one press.
    addEventListener(
      "keydown",
      (event) => event.repeat && closest(event.target, "button") && event.preventDefault(),
      true,
    );
    for (const root of widgets.values()) {
      for (const button of root.querySelectorAll("[type=submit]:not([data-own])")) this.#buttons.set(button, root);
    }
    const form = find(document, "form.page");
    // A click presses at once: a browser takes its time to submit a form.
    form.addEventListener("click", (event) => this.#clicked(event), true);
    // A program may submit a form without a click.
    form.addEventListener("submit", (event) => this.#pressed(event, closest(event.submitter, "button")));
  }

  /** @param {EventTarget | null} target */
  #down(target) {
    this.#downButton = closest(target, "button:enabled");
    this.#downValue = this.#downButton?.value ?? "";
    this.#seen = this.#source.seen; // the view at this moment
    this.#open();
    const root = this.#buttons.get(this.#downButton);
    if (root && asks(root)) this.#loadAsk(root).catch(() => {}); // the click asks
  }

  /** @param {MouseEvent} event */
  #clicked(event) {
    const button = closest(event.target, "button");
    if (button && this.#stops.isPressed(event, button)) return event.preventDefault();
    // A button that was enabled under a resting finger was not pressed.
    if (button && event.detail > 0 && button !== this.#downButton) event.preventDefault();
    else if (this.#buttons.has(button)) this.#pressed(event, button);
  }

  // What fails before a press is sent is said.
  /** @param {Event} event @param {HTMLButtonElement | null} button */
  #pressed(event, button) {
    event.preventDefault();
    const root = this.#buttons.get(button);
    if (!root || !button || button.disabled || !isEquipped(root)) return;
    try {
      this.#begin(event, root, button);
    } catch (error) {
      showReceipt(this.#widgets.values(), root, this.#unsent(error));
    }
  }

  /** @param {unknown} error @returns {Receipt} */
  #unsent(error) {
    console.error(error);
    return { outcome: "refused", reason: pageGuard.page.sentences.unsent };
  }

  // By a pointer, a key or a program. Only a pointer has a "down" before.
  /** @param {Event} event @param {HTMLElement} root @param {HTMLButtonElement} button */
  #begin(event, root, button) {
    const byPointer = event instanceof UIEvent && (event.detail > 0 || event.type.startsWith("pointer"));
    const click = this.#moment(event, byPointer ? this.#seen : this.#source.seen);
    const isCancel = button.matches(".cancel");
    if (isCancel) click.press = byPointer ? this.#downValue : button.value;
    const inputs = enteredValues(); // of this moment: a dialog confirms these
    Object.assign(inputs, hooksOf(root).values?.(button, byPointer ? this.#downValue : button.value));
    /** @param {Event} yes @param {object} [proof] */
    const answered = (yes, proof) => this.#press(root, button, inputs, { ...this.#moment(yes), ...proof });
    if (isCancel || !asks(root)) this.#press(root, button, inputs, click);
    else
      this.#loadAsk(root).then(
        (ask) => ask(root, answered, button, inputs),
        (error) => showReceipt(this.#widgets.values(), root, this.#unsent(error)),
      );
  }

  // The view at an event, and the event's time by the server's clock.
  /** @param {Event} event @param {string | null} [seen] @returns {Click} */
  #moment(event, seen = this.#source.seen) {
    return { seen, at: this.#source.timeOf(event) };
  }

  // Opens the socket at the first touch, before a press can follow. Without a socket, and to cancel, a
  // press is posted.
  #open() {
    clearTimeout(this.#untouchedTimer);
    this.#untouchedTimer = setTimeout(() => this.close(), UNTOUCHED_MS);
    if (!this.#socket)
      import("./press-socket.js").then(
        ({ PressSocket }) => this.#connect(PressSocket),
        () => {},
      );
  }

  /** @param {typeof import("./press-socket.js").PressSocket} PressSocket */
  #connect(PressSocket) {
    this.#socket ??= new PressSocket((socket) => socket === this.#socket && this.close());
  }

  // Also when the event stream is lost. Pending presses still get their responses.
  close() {
    this.#socket?.leave();
    this.#socket = null;
  }

  // A second tap while the first is pending is the same press: it sends nothing.
  /** @param {HTMLElement} root @param {HTMLButtonElement} button @param {Record<string, Data>} inputs @param {Click} click */
  async #press(root, button, inputs, click) {
    const url = button.getAttribute("formaction") ?? "";
    if (this.#pending.has(url)) return;
    this.#pending.add(url);
    try {
      const timeoutMs = RESPONSE_TIMEOUT_MS + 1000 * Number(root.dataset.answerS ?? 0);
      const socket = this.#socket?.free && !button.matches(".cancel") ? this.#socket : null;
      const press = { inputs, id: this.#id, ...click };
      const receipt = this.#send({ widget: root.dataset.widget, ...robotsOf(url) }, socket, url, press, timeoutMs);
      // The press is sent; what can wait follows.
      this.#id = newId();
      forgetRobotValue(root);
      button.setAttribute("aria-busy", "true");
      const pause = new Promise((resolve) => setTimeout(resolve, TAP_AGAIN_MS));
      showReceipt(this.#widgets.values(), root, await receipt);
      await pause;
    } finally {
      this.#pending.delete(url);
      button.removeAttribute("aria-busy");
    }
  }

  // Sent once, never repeated: without a response the outcome is unknown.
  /** @param {{ widget?: string, robots?: string }} address @param {import("./press-socket.js").PressSocket | null} socket @param {string} url @param {Press} press @param {number} timeoutMs @returns {Promise<Receipt>} */
  async #send(address, socket, url, press, timeoutMs) {
    let response = null;
    try {
      response = socket?.send({ ...address, ...press }, timeoutMs) ?? post(url, press, timeoutMs).then(read);
      const { status, error, ...receipt } = await response;
      if (receipt.outcome) return receipt;
      if (status < 500 && error) return { outcome: "refused", reason: error };
    } catch (error) {
      if (!response) return this.#unsent(error);
      if (socket && socket === this.#socket) this.close();
    }
    return { outcome: "unknown", reason: pageGuard.page.sentences.unsure };
  }
}
