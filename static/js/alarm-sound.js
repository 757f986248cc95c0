// Tones of alarms that are not acknowledged, by priority: never the only sign. Made here, from no file. A browser may have
// them silenced for a time; one that permits no sound before a touch says so.
import { find } from "./show.js";

const LOUDNESS = 0.3;
const TONE_S = 0.16;
const APART_S = 0.06;
const LATER_MS = 1000;
const CHECK_MS = 500;
const MINUTE_MS = 60_000;
// The tones of a priority in hertz, and after how many seconds they come again until the alarm is acknowledged.
/** @type {Record<string, { hertz: number[], againS: number }>} */
const TONES = {
  1: { hertz: [988, 784, 988, 784, 988], againS: 5 },
  2: { hertz: [659, 659, 659], againS: 15 },
  3: { hertz: [523, 440], againS: Infinity },
  4: { hertz: [392], againS: Infinity },
};
const HEARD = "kiosk_alarm_sound";
const SILENCED = "kiosk_alarm_silence";

const line = find(document, "form.alarm-line");
const button = find(line, "button.silence");
const priorities = (line.dataset.sound ?? "").split(" ");
const context = new AudioContext();

/** @type {{ server: string, raised: Record<string, number>, at: number }} */
let heard = { server: "", raised: {}, at: 0 };
try {
  heard = { ...heard, ...JSON.parse(sessionStorage.getItem(HEARD) ?? "{}") };
} catch {
  // Nothing was kept that can be read: a tone may come once more.
}
/** @type {Data | null} */
let counts = null; // of each priority; null while there is no connection

button.hidden = false;
for (const choice of document.querySelectorAll("#silence button")) {
  choice.addEventListener("click", () => silence(Number(choice.dataset.minutes)));
}
// A browser permits sound after a touch.
for (const type of ["pointerup", "keydown"]) addEventListener(type, () => context.resume().then(showState), true);
context.addEventListener("statechange", showState);
setInterval(check, CHECK_MS);
showState();

/** @param {Data} alarms @param {string} server the id of the server's run, whose counts begin again */
export function update(alarms, server) {
  counts = alarms.priorities;
  const known = heard.server === server ? heard.raised : null;
  const fresh = priorities.filter((priority) =>
    known ? counts?.[priority].raised > (known[priority] ?? 0) : isOpen(priority),
  );
  heard.server = server;
  heard.raised = Object.fromEntries(priorities.map((priority) => [priority, counts?.[priority].raised ?? 0]));
  if (fresh.length) play(fresh[0]);
  keep();
}

export function lost() {
  counts = null;
}

/** @param {string} priority */
function isOpen(priority) {
  return counts !== null && counts[priority].unacknowledged > 0;
}

// The most urgent priority sounds again.
function check() {
  showState();
  const priority = priorities.find(isOpen);
  if (priority && Date.now() - heard.at >= 1000 * TONES[priority].againS) play(priority);
}

/** @param {string} priority */
function play(priority) {
  if (silencedMs() > 0 || context.state !== "running") return;
  if (Date.now() - heard.at < LATER_MS) return; // a flood is one sound
  heard.at = Date.now();
  keep();
  for (const [i, hertz] of TONES[priority].hertz.entries()) tone(hertz, context.currentTime + i * (TONE_S + APART_S));
}

/** @param {number} frequency @param {number} at */
function tone(frequency, at) {
  const source = new OscillatorNode(context, { type: "triangle", frequency });
  const volume = new GainNode(context, { gain: 0 });
  volume.gain.setValueAtTime(LOUDNESS, at);
  volume.gain.exponentialRampToValueAtTime(0.001, at + TONE_S);
  source.connect(volume).connect(context.destination);
  source.start(at);
  source.stop(at + TONE_S);
}

/** @param {number} minutes */
function silence(minutes) {
  localStorage.setItem(SILENCED, String(Date.now() + minutes * MINUTE_MS));
  find(document, "#silence").hidePopover();
  showState();
}

function silencedMs() {
  return Math.max(0, Number(localStorage.getItem(SILENCED) ?? 0) - Date.now());
}

function showState() {
  const left = silencedMs();
  button.dataset.state = left > 0 ? "silenced" : context.state === "running" ? "on" : "blocked";
  find(button, ".left").textContent = left > 0 ? String(Math.ceil(left / MINUTE_MS)) : "";
}

function keep() {
  sessionStorage.setItem(HEARD, JSON.stringify(heard));
}
