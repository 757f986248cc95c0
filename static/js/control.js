// Control of the robot: the bar that shows its holder, and the holder's keep-alive. The server locks the
// buttons of a client without control. Loaded only where the panel requires control.
import { newId, post, TAP_AGAIN_MS } from "./press.js";
import { find, setText } from "./show.js";

const RESPONSE_TIMEOUT_MS = 5000;
const BEATS_PER_KEEP_ALIVE = 3; // two heartbeats a second; the server releases a holder after 5 s of silence
const TOUCH_INTERVAL_MS = 1000;
const IN_CONTROL = ["holding", "asked"];

export class Control {
  /** @type {HTMLFormElement} */
  #bar;
  #beats = 0;
  #touchedAt = -Infinity;
  #asker = ""; // who requested control when the finger went down
  #busy = false;
  /** @type {(event: Event) => string} */
  #timeOf;

  // `timeOf` returns the server's time of an event.
  /** @param {HTMLFormElement} bar @param {(event: Event) => string} timeOf */
  constructor(bar, timeOf) {
    this.#bar = bar;
    this.#timeOf = timeOf;
    for (const kind of ["pointerdown", "keydown"]) addEventListener(kind, () => this.#touch(), true);
    this.#bar.addEventListener("submit", (event) => {
      event.preventDefault();
      if (event.submitter) this.#act(event.submitter, this.#timeOf(event));
    });
  }

  /** @param {{ role: string, shown: string, asker: string }} content */
  show({ role, shown, asker }) {
    this.#bar.dataset.role = role;
    find(this.#bar, "input[name=to]").value = asker;
    find(this.#bar, ".refused").textContent = "";
    setText(find(this.#bar, ".who"), shown);
    for (const button of this.#bar.querySelectorAll("button")) {
      button.hidden = !button.dataset.roles?.split(" ").includes(role);
      button.disabled = false;
    }
  }

  lost() {
    this.#bar.dataset.role = "";
    find(this.#bar, ".who").textContent = pageGuard.page.sentences.unknown;
    for (const button of this.#bar.querySelectorAll("button")) button.disabled = true;
  }

  beat() {
    if (![...IN_CONTROL, "asking"].includes(this.#role)) return;
    this.#beats += 1;
    if (this.#beats >= BEATS_PER_KEEP_ALIVE) this.#keepAlive(false);
  }

  get #role() {
    return this.#bar.dataset.role ?? "";
  }

  #touch() {
    this.#asker = find(this.#bar, "input[name=to]").value;
    const now = performance.now();
    if (!IN_CONTROL.includes(this.#role) || now - this.#touchedAt < TOUCH_INTERVAL_MS) return;
    this.#touchedAt = now;
    this.#keepAlive(true);
  }

  /** @param {boolean} touched */
  #keepAlive(touched) {
    this.#beats = 0;
    this.#post("here", { touched }, true).catch(() => {}); // the next one may get through
  }

  // A second tap is the same act: it must not meet the button that came in its place.
  /** @param {HTMLElement} button @param {string} at */
  async #act(button, at) {
    if (this.#busy || button.matches(":disabled")) return;
    this.#busy = true;
    this.#bar.setAttribute("aria-busy", "true");
    const pause = new Promise((resolve) => setTimeout(resolve, TAP_AGAIN_MS));
    const refusal = find(this.#bar, ".refused");
    try {
      const act = button.getAttribute("formaction")?.split("/").at(-1);
      const answer = await (await this.#post(act, { to: this.#asker, at, id: newId() })).json();
      refusal.textContent = answer.reason ?? answer.error;
    } catch {
      refusal.textContent = pageGuard.page.sentences.unsure;
    }
    await pause;
    this.#busy = false;
    this.#bar.removeAttribute("aria-busy");
  }

  /** @param {string | undefined} act @param {object} body @param {boolean} keepalive */
  #post(act, body, keepalive = false) {
    return post(`${pageGuard.page.base}/control/${act}`, body, RESPONSE_TIMEOUT_MS, { keepalive });
  }
}
