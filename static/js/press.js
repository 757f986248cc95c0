// A press: sent once on release, with an id. Its receipt is shown at the pressed widget.
import { newId, post } from "./connection.js";
import { enteredValues, forgetRobotValue } from "./entries.js";
import { showReceipt } from "./show.js";

const RESPONSE_TIMEOUT_MS = 5000;
// A second tap within this time is the same press.
export const TAP_AGAIN_MS = 700;
// The socket of a page that is not touched for so long is closed.
const UNTOUCHED_MS = 60_000;
const read = async (response) => ({ ...(await response.json()), status: response.status });

export class Presser {
  #socket = null;
  #untouchedTimer = 0;
  #widgets;
  #sentences;
  #source;
  #pending = new Set(); // URLs of presses without a response yet
  #downButton = null; // the enabled button under the pointer when it went down
  #downValue = ""; // of that button then: the goal that it cancels, or the value that a key of a step sends
  #confirm = () => {}; // of ask.js, which is loaded with the page: nothing is pressed before that
  #seen = null;
  #id = newId(); // of the next press
  #buttons = new Map(); // submit button → its widget

  constructor(widgets, source, sentences) {
    this.#widgets = widgets;
    this.#sentences = sentences;
    this.#source = source;
    if (document.querySelector("dialog.ask")) source.load("./ask.js", ({ confirm }) => (this.#confirm = confirm));
    addEventListener("pointerdown", ({ target }) => this.#down(target), true);
    // A key that is held down is one press.
    addEventListener(
      "keydown",
      (event) => event.repeat && event.target.closest?.("button") && event.preventDefault(),
      true,
    );
    for (const root of widgets.values()) {
      for (const button of root.querySelectorAll("[type=submit]")) this.#buttons.set(button, root);
    }
    const form = document.querySelector("form.page");
    // A click presses at once: a browser takes its time to submit a form.
    form.addEventListener("click", (event) => this.#clicked(event), true);
    // A program may submit a form without a click.
    form.addEventListener("submit", (event) => this.#pressed(event, event.submitter));
  }

  #down(target) {
    this.#downButton = target.closest?.("button:enabled");
    this.#downValue = this.#downButton?.value;
    this.#seen = this.#source.seen; // the view at this moment
    this.#open();
  }

  #clicked(event) {
    const button = event.target.closest("button");
    // A button that was enabled under a resting finger was not pressed.
    if (button && event.detail > 0 && button !== this.#downButton) event.preventDefault();
    else if (this.#buttons.has(button)) this.#pressed(event, button);
  }

  // What fails before a press is sent is said.
  #pressed(event, button) {
    event.preventDefault();
    const root = this.#buttons.get(button);
    if (!root || button.disabled) return;
    try {
      this.#begin(event, root, button);
    } catch (error) {
      showReceipt(this.#widgets.values(), root, this.#unsent(error));
    }
  }

  #unsent(error) {
    console.error(error);
    return { outcome: "refused", reason: this.#sentences.unsent };
  }

  // By a pointer, a key or a program. Only a pointer has a "down" before.
  #begin(event, root, button) {
    // The robot's response arrives as an event.
    if (button.matches(".read"))
      return void fetch(button.getAttribute("formaction"), { method: "POST" }).catch(() => {});
    const byPointer = event.detail > 0;
    const click = this.#moment(event, byPointer ? this.#seen : this.#source.seen);
    const isCancel = button.matches(".cancel");
    if (isCancel) click.press = byPointer ? this.#downValue : button.value;
    const inputs = enteredValues(); // of this moment: a dialog confirms these
    // The key of a step has the value that was shown when the finger went down.
    if (button.matches(".step-key")) inputs[button.name] = Number(byPointer ? this.#downValue : button.value);
    if (isCancel || !root.querySelector("dialog.ask")) this.#press(root, button, inputs, click);
    else this.#confirm(root, button.form, (yes) => this.#press(root, button, inputs, this.#moment(yes)));
  }

  // The view at an event, and the event's time by the server's clock.
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

  #connect(PressSocket) {
    this.#socket ??= new PressSocket((socket) => socket === this.#socket && this.close());
  }

  // Also when the event stream is lost. Pending presses still get their responses.
  close() {
    this.#socket?.leave();
    this.#socket = null;
  }

  // A second tap while the first is pending is the same press: it sends nothing.
  async #press(root, button, inputs, click) {
    const url = button.getAttribute("formaction");
    if (this.#pending.has(url)) return;
    this.#pending.add(url);
    try {
      const timeoutMs = RESPONSE_TIMEOUT_MS + 1000 * (root.dataset.answerS ?? 0);
      const socket = this.#socket?.free && !button.matches(".cancel") ? this.#socket : null;
      const receipt = this.#send(root.dataset.widget, socket, url, { inputs, id: this.#id, ...click }, timeoutMs);
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
  async #send(widget, socket, url, press, timeoutMs) {
    let response = null;
    try {
      response = socket?.send({ widget, ...press }, timeoutMs) ?? post(url, press, timeoutMs).then(read);
      const { status, error, ...receipt } = await response;
      if (receipt.outcome) return receipt;
      if (status < 500 && error) return { outcome: "refused", reason: error };
    } catch (error) {
      if (!response) return this.#unsent(error);
      if (socket && socket === this.#socket) this.close();
    }
    return { outcome: "unknown", reason: this.#sentences.unsure };
  }
}
