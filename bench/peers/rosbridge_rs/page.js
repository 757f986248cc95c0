import { Ros, Topic } from "roslib";

const button = document.getElementById("publish");
const text = document.getElementById("text");
const ros = new Ros({ url: `ws://127.0.0.1:${new URLSearchParams(location.search).get("port")}` });
const topic = (name, messageType) => new Topic({ ros, name, messageType });

topic("/operation_enabled", "std_msgs/msg/Bool").subscribe((message) => {
  button.disabled = !message.data;
});
for (const shown of document.querySelectorAll("[data-topic]")) {
  topic(shown.dataset.topic, "std_msgs/msg/String").subscribe((message) => {
    shown.textContent = message.data;
  });
}

const operation = topic("/operation1", "std_msgs/msg/String");
operation.advertise();
button.addEventListener("click", () => operation.publish({ data: text.value }));
