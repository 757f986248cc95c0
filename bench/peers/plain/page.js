const button = document.getElementById("publish");
const text = document.getElementById("text");
const shown = new Map(
  Array.from(document.querySelectorAll("[data-topic]"), (element) => [element.dataset.topic, element]),
);

new EventSource("/events").onmessage = (event) => {
  const { topic, value } = JSON.parse(event.data);
  if (topic === "/operation_enabled") button.disabled = !value;
  else shown.get(topic).textContent = value;
};

function byFetch() {
  return (text) => fetch("/press", { method: "POST", body: JSON.stringify({ text }) });
}

function byWebSocket() {
  const socket = new WebSocket(`ws://${location.host}/presses`);
  return (text) => socket.send(text);
}

const press = location.search === "?websocket" ? byWebSocket() : byFetch();
button.addEventListener("click", () => press(text.value));
