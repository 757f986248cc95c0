// A button that acts while it is held. It ends by whatever may mean that nobody holds it any more,
// and only a new press begins again. What it shows is what the server answered, nothing else.
import { entered } from "../press.js";

// From this page's own thread on purpose: a page that stands still must not keep a hold alive.
const BEAT_MS = 80;
// Without an answer for so long the server does not hold any more.
const SILENCE_MS = 500;
// The last answer waits for the disk.
const LAST_ANSWER_MS = 3000;
const KEYS = [" ", "Enter"];

// Called for each widget of this kind.
export const equip = (root, source) => new Hold(root, source);

class Hold {
  #root;
  #button;
  #source;
  #socket = null; // of the hold that is going on; null when there is none
  #lease = "";
  #stamp = 0; // the server's last one, and when it came
  #stampedAt = 0;
  #number = 0;
  #timer = 0;
  #pointer = null;
  #key = null;
  #waiting = new Map(); // socket → why, of holds that were let go and have no last answer yet

  constructor(root, source) {
    this.#root = root;
    this.#button = root.querySelector("button");
    this.#source = source;
    const button = this.#button;
    button.addEventListener("pointerdown", (event) => this.#down(event));
    button.addEventListener("pointerleave", (event) => event.pointerId === this.#pointer && this.#end("sliding"));
    // A long touch is no wish for a menu here; pointer events come all the same.
    button.addEventListener("touchstart", (event) => event.preventDefault(), { passive: false });
    button.addEventListener("keydown", (event) => this.#keyDown(event));
    button.addEventListener("contextmenu", (event) => {
      event.preventDefault();
      this.#end("menu");
    });
    button.addEventListener("blur", () => this.#end("blur"));
    button.addEventListener("dragstart", (event) => event.preventDefault());
    this.#watch();
  }

  // All that ends a hold from elsewhere on the page.
  #watch() {
    const on = (target, name, does) => target.addEventListener(name, does, { capture: true });
    on(window, "pointerdown", (event) => event.pointerId !== this.#pointer && this.#end("second"));
    on(window, "pointerup", (event) => event.pointerId === this.#pointer && this.#end("released"));
    on(window, "pointercancel", (event) => event.pointerId === this.#pointer && this.#end("cancel"));
    on(window, "keyup", (event) => event.key === this.#key && this.#end("released"));
    on(window, "keydown", (event) => event.key === "Escape" && this.#end("escape"));
    on(window, "blur", (event) => event.target === window && this.#end("blur"));
    on(document, "visibilitychange", () => document.hidden && this.#end("hiding"));
    on(window, "pagehide", () => this.#end("leaving"));
    // A lock, and the loss of the event stream, which locks all.
    new MutationObserver(() => this.#button.disabled && this.#end("lock")).observe(this.#button, {
      attributeFilter: ["disabled"],
    });
  }

  #down(event) {
    if (!event.isPrimary || event.button !== 0 || this.#busy) return;
    // A finger's pointer stays with the button by itself: it must be seen to slide off.
    if (this.#button.hasPointerCapture(event.pointerId)) this.#button.releasePointerCapture(event.pointerId);
    this.#pointer = event.pointerId;
    this.#begin();
  }

  #keyDown(event) {
    if (!KEYS.includes(event.key)) return;
    event.preventDefault();
    if (event.repeat || this.#busy) return;
    this.#key = event.key;
    this.#begin();
  }

  get #busy() {
    return this.#socket !== null || this.#button.disabled || document.hidden;
  }

  #begin() {
    this.#root.dataset.hold = "asked";
    this.#show("", "");
    this.#lease = "";
    this.#number = 0;
    const path = `${document.body.dataset.base}/widgets/${this.#root.dataset.widget}/hold`;
    const socket = new WebSocket(new URL(path, location).href.replace(/^http/, "ws"));
    this.#socket = socket;
    this.#stampedAt = performance.now();
    let begun = false;
    socket.onmessage = ({ data }) => {
      const on = socket === this.#socket;
      if (!on && !this.#waiting.has(socket)) return;
      const said = JSON.parse(data);
      this.#stamp = said.stamp;
      this.#stampedAt = performance.now();
      if (!begun && on) this.#say(socket, { do: "begin", inputs: entered(), seen: this.#source.seen });
      else if (!begun) this.#say(socket, { do: "end", why: this.#waiting.get(socket) });
      begun = true;
      if (said.state === "held") on && this.#held(socket, said);
      else if (said.state) this.#over(socket, said);
    };
    socket.onclose = () => this.#lost(socket);
    this.#timer = setInterval(() => this.#beat(socket), BEAT_MS);
  }

  #say(socket, what) {
    if (socket.readyState !== WebSocket.OPEN) return;
    socket.send(JSON.stringify({ ...what, stamp: this.#stamp, after: performance.now() - this.#stampedAt }));
  }

  #beat(socket) {
    if (performance.now() - this.#stampedAt > SILENCE_MS) this.#end("silence");
    else if (this.#lease) this.#say(socket, { do: "beat", number: ++this.#number, lease: this.#lease });
  }

  #held(socket, said) {
    if (!said.lease) return;
    this.#lease = said.lease;
    this.#beat(socket); // on a slow way the next one may come too late
    this.#root.dataset.hold = "held";
    this.#button.setAttribute("aria-pressed", "true");
  }

  // On this side it ends at once; what is shown then is the server's answer.
  #end(why) {
    const socket = this.#socket;
    if (!socket) return;
    this.#reset();
    this.#say(socket, { do: "end", why, lease: this.#lease });
    if (why === "silence" || why === "leaving") {
      socket.close();
      if (why === "silence") this.#show("unknown", this.#root.dataset.cut);
    } else {
      this.#waiting.set(socket, why);
      setTimeout(() => socket.close(), LAST_ANSWER_MS);
    }
  }

  #over(socket, said) {
    this.#waiting.delete(socket);
    if (socket === this.#socket) this.#reset();
    else if (this.#socket) return;
    this.#show(said.outcome, said.reason);
    socket.close();
  }

  #lost(socket) {
    const unanswered = this.#waiting.delete(socket);
    if (socket === this.#socket) this.#reset();
    else if (!unanswered || this.#socket) return;
    this.#show("unknown", this.#root.dataset.cut);
  }

  #reset() {
    clearInterval(this.#timer);
    this.#socket = this.#pointer = this.#key = null;
    delete this.#root.dataset.hold;
    this.#button.setAttribute("aria-pressed", "false");
  }

  #show(outcome, reason) {
    const receipt = this.#root.querySelector(".receipt");
    receipt.dataset.outcome = outcome;
    receipt.textContent = reason;
  }
}
