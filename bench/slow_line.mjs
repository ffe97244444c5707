// A slow line: a relay between browser and server on this machine that lets only so many kbit/s
// through to the browser. (The network conditions of the browser's own tools do not slow down
// WebSockets.)

import { connect, createServer } from "node:net";

/** Milliseconds between two portions. */
const TICK = 10;

/** Relays to the server at this address; gives the address to open and a way to end it. */
export async function slowLine(address, kilobits) {
  const target = new URL(address);
  const perMillisecond = kilobits / 8;
  const most = 4 * TICK * perMillisecond;
  const sockets = new Set();
  const waiting = [];
  const relay = createServer((browser) => {
    const server = connect(Number(target.port), target.hostname);
    for (const socket of [browser, server]) {
      sockets.add(socket);
      socket.on("error", () => {});
      socket.on("close", () => {
        sockets.delete(socket);
        browser.destroy();
        server.destroy();
      });
    }
    // The server answers only requests that name its own port.
    const own = `:${relay.address().port}`;
    browser.on("data", (data) => {
      const text = data.toString("latin1").replaceAll(own, `:${target.port}`);
      server.write(Buffer.from(text, "latin1"));
    });
    // What waits here is little, so that the server feels the line.
    const queue = { browser, server, chunks: [], bytes: 0 };
    waiting.push(queue);
    server.on("data", (data) => {
      queue.chunks.push(data);
      queue.bytes += data.length;
      if (queue.bytes > most) server.pause();
    });
  });
  let last = performance.now();
  let left = 0;
  const timer = setInterval(() => {
    // A busy machine keeps no time: what counts is how much has passed.
    const now = performance.now();
    const isIdle = waiting.every((queue) => queue.chunks.length === 0);
    left = isIdle ? 0 : left + (now - last) * perMillisecond;
    last = now;
    for (const queue of waiting) {
      while (left >= 1 && queue.chunks.length > 0) {
        const chunk = queue.chunks.shift();
        const portion = chunk.subarray(0, Math.floor(left));
        if (portion.length < chunk.length) queue.chunks.unshift(chunk.subarray(portion.length));
        queue.browser.write(portion);
        left -= portion.length;
        queue.bytes -= portion.length;
      }
      if (queue.bytes <= most) queue.server.resume();
    }
  }, TICK);
  await new Promise((resolve) => relay.listen(0, "127.0.0.1", resolve));
  const url = new URL(address);
  url.port = String(relay.address().port);
  const close = () => {
    clearInterval(timer);
    relay.close();
    for (const socket of sockets) socket.destroy();
  };
  return { url: url.href, close };
}
