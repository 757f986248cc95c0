// A map and a pose as a page on roslib shows them: the cells as one picture, the robot above it.
import { Ros, Topic } from "roslib";

const main = document.querySelector("main");
const canvas = document.querySelector("canvas");
const robot = document.getElementById("robot");
const ros = new Ros({ url: `ws://127.0.0.1:${new URLSearchParams(location.search).get("port")}` });
const topic = (name, messageType) => new Topic({ ros, name, messageType });

let metres = 1; // across the map

topic("/map", "nav_msgs/msg/OccupancyGrid").subscribe(({ info: { width, height, resolution }, data }) => {
  const image = new ImageData(width, height);
  const pixels = new Uint32Array(image.data.buffer);
  for (let row = 0; row < height; row++) {
    const into = (height - 1 - row) * width;
    for (let column = 0; column < width; column++) {
      const value = data[row * width + column];
      pixels[into + column] = value < 0 ? 0xff808080 : value >= 65 ? 0xff000000 : 0xffffffff;
    }
  }
  canvas.width = width;
  canvas.height = height;
  canvas.getContext("2d").putImageData(image, 0, 0);
  metres = width * resolution;
  main.dataset.maps = String(Number(main.dataset.maps) + 1);
});
topic("/pose", "geometry_msgs/msg/PoseStamped").subscribe(({ pose: { position } }) => {
  const scale = main.clientWidth / metres;
  robot.style.transform = `translate(${position.x * scale}px, ${main.clientHeight - position.y * scale}px)`;
});
ros.on("connection", () => {
  main.dataset.ready = "true";
});
