// The line of alarms below the header: the newest unacknowledged alarm of the highest priority, and its Acknowledge.
import { newId, post, TAP_AGAIN_MS } from "./press.js";
import { closest, find, setText } from "./show.js";

const RESPONSE_TIMEOUT_MS = 5000;
const IN_CONTROL = ["", "holding", "asked"];
const TEXTS = ["priority_text", "since_text", "text", "action"];

/** @param {string} path @param {object} body @returns {Promise<Data>} */
async function sendAct(path, body) {
  const { root } = find(document, ".alarm-line").dataset;
  try {
    const answer = await (await post(`${root}/alarms/${path}`, body, RESPONSE_TIMEOUT_MS)).json();
    return answer.error ? { reason: answer.error } : answer;
  } catch {
    return { reason: pageGuard.page.sentences.unsure };
  }
}

export class AlarmLine {
  #line = find(document, "form.alarm-line");
  #button = find(this.#line, "button");
  #source;
  /** @type {{ id: string, occurrence: number, seen: string | null } | null} */
  #touched = null; // the alarm that the line showed when the finger went down on an enabled button
  #refusedFor = "";
  #isSnapshot = true; // the next section is whole: the first of a stream
  #busy = false;
  /** @type {(alarms: Data, isSnapshot: boolean) => void} */
  #showRows = () => {}; // of a page without the list
  #lockActs = () => {};

  /** @param {import("./source.js").Source} source */
  constructor(source) {
    this.#source = source;
    if (document.querySelector("ol.alarms"))
      source.load(import("./alarm-list.js"), ({ showRows, lockActs }) => {
        this.#showRows = showRows;
        this.#lockActs = lockActs;
      });
    addEventListener("pointerdown", ({ target }) => this.#down(target), true);
    this.#button.addEventListener("click", (event) => {
      event.preventDefault();
      this.#acknowledge(event);
    });
    this.#line.addEventListener("submit", (event) => event.preventDefault());
  }

  /** @param {Data} alarms */
  show(alarms) {
    const row = alarms.line;
    const { dataset } = this.#line;
    delete dataset.cut;
    dataset.alarm = row?.id ?? "";
    dataset.priority = row?.priority ?? "";
    dataset.known = row?.known ?? true;
    dataset.standing = alarms.standing;
    find(this.#line, "input[name=occurrence]").value = row?.occurrence ?? "";
    for (const name of TEXTS) setText(this.#text(name), row?.[name] ?? "");
    setText(this.#text("unacknowledged"), String(alarms.unacknowledged));
    setText(this.#text("standing"), String(alarms.standing));
    const badge = document.querySelector(".pages .badge");
    if (badge) badge.dataset.priority = dataset.priority;
    this.#showRows(alarms, this.#isSnapshot);
    this.#isSnapshot = false;
    if (this.#refusedFor !== this.#shown) setText(find(this.#line, ".refused"), "");
    this.#lock();
  }

  /** @param {string} role */
  control(role) {
    this.#line.dataset.lock = IN_CONTROL.includes(role) ? "" : "control";
    this.#lock();
  }

  lost() {
    this.#line.dataset.cut = "";
    this.#isSnapshot = true;
    this.#touched = null;
    this.#lock();
  }

  #lock() {
    const { alarm, lock, cut } = this.#line.dataset;
    this.#button.disabled = !alarm || lock !== "" || cut !== undefined;
    this.#lockActs();
  }

  /** @param {string} name */
  #text(name) {
    return find(this.#line, `[data-text="${name}"]`);
  }

  get #shown() {
    return `${this.#line.dataset.alarm} ${find(this.#line, "input[name=occurrence]").value}`;
  }

  // The alarm that is shown now.
  #alarm() {
    const occurrence = Number(find(this.#line, "input[name=occurrence]").value);
    return { id: this.#line.dataset.alarm ?? "", occurrence, seen: this.#source.seen };
  }

  /** @param {EventTarget | null} target */
  #down(target) {
    this.#touched = closest(target, "button:enabled") === this.#button ? this.#alarm() : null;
  }

  // Acknowledges what was shown at the touch. A second tap is the same act: it must not meet the next alarm.
  /** @param {MouseEvent} event */
  async #acknowledge(event) {
    const alarm = event.detail > 0 ? this.#touched : this.#alarm();
    if (!alarm || this.#busy) return;
    this.#busy = true;
    this.#line.setAttribute("aria-busy", "true");
    const pause = new Promise((resolve) => setTimeout(resolve, TAP_AGAIN_MS));
    const { id, occurrence, seen } = alarm;
    const body = { occurrence, seen: seen ?? "", at: this.#source.timeOf(event), id: newId() };
    const { reason } = await sendAct(`${encodeURIComponent(id)}/acknowledge`, body);
    this.#refusedFor = this.#shown;
    setText(find(this.#line, ".refused"), reason);
    await pause;
    this.#busy = false;
    this.#line.removeAttribute("aria-busy");
  }
}
