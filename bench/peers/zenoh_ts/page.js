import { Config, Session } from "@eclipse-zenoh/zenoh-ts";

const CDR = [0, 1, 0, 0];
const button = document.getElementById("publish");
const text = document.getElementById("text");

function textOf(cdr) {
  const length = new DataView(cdr.buffer, cdr.byteOffset).getUint32(4, true); // with the NUL at its end
  return new TextDecoder().decode(cdr.subarray(8, 7 + length));
}

function cdrOf(text) {
  const data = new TextEncoder().encode(text);
  const cdr = new Uint8Array(8 + data.length + 1);
  cdr.set(CDR);
  new DataView(cdr.buffer).setUint32(4, data.length + 1, true);
  cdr.set(data, 8);
  return cdr;
}

const port = new URLSearchParams(location.search).get("port");
const session = await Session.open(new Config(`ws/127.0.0.1:${port}`));
await session.declareSubscriber("operation_enabled", {
  handler: (sample) => {
    button.disabled = sample.payload().toBytes()[4] === 0;
  },
});
const publisher = await session.declarePublisher("operation1");
button.addEventListener("click", () => publisher.put(cdrOf(text.value)));

for (const shown of document.querySelectorAll("[data-topic]")) {
  await session.declareSubscriber(shown.dataset.topic.slice(1), {
    handler: (sample) => {
      shown.textContent = textOf(sample.payload().toBytes());
    },
  });
}
