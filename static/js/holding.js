// Hold-to-run, by a key or a joystick: acts while it is held. Every event that may mean a release ends the hold, and
// only a new press starts another one. The page shows the server's response, nothing else.
import { enteredValues } from "./entries.js";
import { HoldProof } from "./hold-proof.js";
import { showOutcome } from "./receipts.js";
import { find } from "./show.js";

// On the page's own thread on purpose: a page that stalls must not keep a hold alive.
const BEAT_MS = 80;
// Without a response for so long the server has ended the hold.
const SILENCE_MS = 500;
// The last response waits for the disk.
const LAST_RESPONSE_MS = 3000;
export class Holding {
  root;
  button;
  /** @type {import("./source.js").Source} */
  #source;
  #proof;
  /** @type {WebSocket | null} */
  #socket = null; // of the current hold; null without one
  #lease = "";
  #stamp = 0; // the server's last stamp, and when it arrived
  #stampedAt = 0;
  #number = 0;
  #timer = 0;
  /** @type {number | null} */
  pointer = null; // the pointer or the key that holds it
  /** @type {string | null} */
  key = null;
  /** @type {Map<WebSocket, string>} */
  #ending = new Map(); // socket → reason, of ended holds without their last response

  /** @param {HTMLElement} root @param {import("./source.js").Source} source */
  constructor(root, source) {
    this.root = root;
    this.button = find(root, "button.hold");
    this.#source = source;
    this.#proof = new HoldProof(root, (outcome, reason) => this.#show(outcome, reason));
    // A long touch must not open a menu; pointer events arrive all the same.
    this.button.addEventListener("touchstart", (event) => event.preventDefault(), { passive: false });
    this.button.addEventListener("dragstart", (event) => event.preventDefault());
    listenForEnd(
      this.button,
      () => this.pointer,
      () => this.key,
      (why) => this.end(why),
    );
  }

  // What each heartbeat has in it; a joystick has its deflection.
  /** @returns {object} */
  heartbeatData() {
    return {};
  }

  // The server's response to a heartbeat: the texts of what it has sent to the robot.
  /** @param {Record<string, string>} _moves */
  onResponse(_moves) {}

  // The hold has ended.
  onEnd() {}

  get busy() {
    return this.#socket !== null || this.button.disabled || document.hidden;
  }

  get isHeld() {
    return this.#socket !== null;
  }

  begin() {
    if (this.#proof.isMissing) {
      this.pointer = this.key = null;
      return void this.#proof.ask();
    }
    const proof = this.#proof.take();
    this.root.dataset.hold = "asked";
    this.#show("", "");
    this.#lease = "";
    this.#number = 0;
    const { base, embed } = pageGuard.page;
    const path = `${base}/widgets/${this.root.dataset.widget}/hold${embed}`;
    const socket = new WebSocket(new URL(path, location.href).href.replace(/^http/, "ws"));
    this.#socket = socket;
    this.#stampedAt = performance.now();
    let begun = false;
    socket.onmessage = ({ data }) => {
      const isCurrent = socket === this.#socket;
      if (!isCurrent && !this.#ending.has(socket)) return;
      const message = JSON.parse(data);
      this.#stamp = message.stamp;
      this.#stampedAt = performance.now();
      const begin = { do: "begin", inputs: enteredValues(), seen: this.#source.seen, ...proof };
      if (!begun && isCurrent) this.#send(socket, begin);
      else if (!begun) this.#send(socket, { do: "end", why: this.#ending.get(socket) });
      begun = true;
      if (message.state === "held") isCurrent && this.#held(socket, message);
      else if (message.state) this.#ended(socket, message);
    };
    socket.onclose = () => this.#lost(socket);
    this.#timer = setInterval(() => this.beat(socket), BEAT_MS);
  }

  /** @param {WebSocket | null} socket @param {object} message */
  #send(socket, message) {
    if (socket?.readyState !== WebSocket.OPEN) return;
    socket.send(JSON.stringify({ ...message, stamp: this.#stamp, after: performance.now() - this.#stampedAt }));
  }

  // Between the regular ones too, where there is news.
  beat(socket = this.#socket) {
    if (performance.now() - this.#stampedAt > SILENCE_MS) this.end("silence");
    else if (this.#lease)
      this.#send(socket, { do: "beat", number: ++this.#number, lease: this.#lease, ...this.heartbeatData() });
  }

  /** @param {WebSocket} socket @param {{ lease?: string, moves?: Record<string, string> }} message */
  #held(socket, { lease, moves }) {
    if (moves) this.onResponse(moves);
    if (!lease) return;
    this.#lease = lease;
    this.beat(socket); // on a slow network the next one may be too late
    this.root.dataset.hold = "held";
    this.button.setAttribute("aria-pressed", "true");
  }

  // Ends the hold on this page at once; the server's response is shown after.
  /** @param {string} why */
  end(why) {
    const socket = this.#socket;
    if (!socket) return;
    this.#reset();
    this.#send(socket, { do: "end", why, lease: this.#lease });
    if (why === "silence" || why === "leaving") {
      socket.close();
      if (why === "silence") this.#show("unknown", this.root.dataset.cut);
    } else {
      this.#ending.set(socket, why);
      setTimeout(() => socket.close(), LAST_RESPONSE_MS);
    }
  }

  /** @param {WebSocket} socket @param {Receipt} message */
  #ended(socket, { outcome, reason }) {
    this.#ending.delete(socket);
    if (socket === this.#socket) this.#reset();
    else if (this.#socket) return;
    this.#show(outcome, reason);
    socket.close();
  }

  /** @param {WebSocket} socket */
  #lost(socket) {
    const unanswered = this.#ending.delete(socket);
    if (socket === this.#socket) this.#reset();
    else if (!unanswered || this.#socket) return;
    this.#show("unknown", this.root.dataset.cut);
  }

  #reset() {
    clearInterval(this.#timer);
    this.#socket = this.pointer = this.key = null;
    delete this.root.dataset.hold;
    this.button.setAttribute("aria-pressed", "false");
    this.onEnd();
  }

  /** @param {string} outcome @param {string | undefined} reason */
  #show(outcome, reason) {
    showOutcome(find(this.root, ".receipt"), outcome, reason);
  }
}

// The events that end a hold.
// Calls `end(why)`. `pointer` and `key` return the pointer id and the key that hold the button, or null.
/** @param {HTMLButtonElement} button @param {() => number | null} pointer @param {() => string | null} key @param {(why: string) => void} end */
function listenForEnd(button, pointer, key, end) {
  /** @template {keyof WindowEventMap} K @param {EventTarget} target @param {K} name @param {(event: WindowEventMap[K]) => void} listener */
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
