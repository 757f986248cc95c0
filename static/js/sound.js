// A short low tone for a press that was refused, and for nothing else.
const HERTZ = 196;
const LASTS_S = 0.18;
const LOUDNESS = 0.25;

let context = null; // made by the first refusal: a browser permits sound after a touch only

function sound() {
  context ??= new AudioContext();
  const tone = new OscillatorNode(context, { type: "triangle", frequency: HERTZ });
  const volume = new GainNode(context, { gain: LOUDNESS });
  volume.gain.exponentialRampToValueAtTime(0.001, context.currentTime + LASTS_S);
  tone.connect(volume).connect(context.destination);
  tone.start();
  tone.stop(context.currentTime + LASTS_S);
}

const receipts = new MutationObserver((changes) => {
  if (changes.some(({ target }) => target instanceof HTMLElement && target.dataset.outcome === "refused")) sound();
});
for (const receipt of document.querySelectorAll(".receipt"))
  receipts.observe(receipt, { attributeFilter: ["data-outcome"] });
document.documentElement.dataset.sound = ""; // refusals are heard from now on
