// The page in a real browser, against the real server. `cargo xtask web` runs this.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { request } from "node:http";
import { test } from "node:test";
import { fileURLToPath } from "node:url";
import {
  copiedCommand,
  drag,
  fingerprint,
  isDone,
  isRenderedBy,
  open,
  PATIENCE,
  SNELL,
  serve,
  settled,
} from "./browser.mjs";

/** Status of a request with headers of one's own choice. */
const status = (url, headers) =>
  new Promise((resolve, reject) => {
    const asked = request(url, { headers }, (response) => {
      response.resume();
      resolve(response.statusCode);
    });
    asked.on("error", reject);
    asked.end();
  });

test("the page shows the scene, turns it, and at rest has the bits of snell render", {
  timeout: PATIENCE * 2,
}, async () => {
  const server = await serve("cornell-box", "--", "--spp", "4");
  try {
    const { page, faults } = await open(server.url);
    await isDone(page);
    const first = await fingerprint(page);
    await drag(page, 60, 20);
    await page.waitForSelector("canvas[data-kind=jpeg]");
    await isDone(page);
    assert.notEqual(await fingerprint(page), first, "the picture has turned");

    const command = await copiedCommand(page);
    assert.ok(
      command.some((w) => w.startsWith("camera.0.eye=")),
      command.join(" "),
    );
    await isRenderedBy(command, page);

    // Exposure is a matter of the page: the same samples, another picture.
    const before = await fingerprint(page);
    await page.getByLabel("Exposure (stops)").last().fill("2");
    await page.keyboard.press("Tab");
    await page.waitForTimeout(200);
    assert.notEqual(await fingerprint(page), before);
    assert.deepEqual(faults, []);
    await page.close();
  } finally {
    await server.stop();
  }
});

test("a camera that was made for the scene is that of the command, for any shape of the page", {
  timeout: PATIENCE * 2,
}, async () => {
  const server = await serve(
    fileURLToPath(new URL("../../scenes/house.obj", import.meta.url)),
    "--",
    "--spp",
    "1",
  );
  try {
    const { page } = await open(server.url);
    await page.setViewportSize({ width: 700, height: 900 });
    await page.waitForTimeout(500);
    await isDone(page);
    await isRenderedBy(await copiedCommand(page), page);
    await page.close();
  } finally {
    await server.stop();
  }
});

test("pixels are picked, materials changed and changed back, pictures saved", {
  timeout: PATIENCE * 2,
}, async () => {
  const server = await serve("cornell-box", "--", "--spp", "1");
  try {
    const { page, faults } = await open(server.url);
    await isDone(page);
    const before = await fingerprint(page);
    const box = await page.locator(".stage").boundingBox();
    await page.mouse.click(box.x + box.width / 2, box.y + box.height * 0.4);
    const facts = await page.locator(".facts").innerText();
    assert.match(facts, /Material\s+white/);

    const generation = (n) =>
      page.waitForFunction((old) => document.querySelector("canvas").dataset.frame !== old, n);
    const shown = await page.evaluate(() => document.querySelector("canvas").dataset.frame);
    await page.getByLabel("reflectance red", { exact: true }).fill("0.05");
    await page.keyboard.press("Tab");
    await generation(shown);
    await isDone(page);
    assert.notEqual(await fingerprint(page), before, "a material has changed");
    const changed = await page.evaluate(() => document.querySelector("canvas").dataset.frame);
    await page.getByText("Undo", { exact: true }).click();
    await page.waitForSelector("button:has-text('Undo'):disabled");
    await generation(changed);
    assert.equal(await settled(page, before), before, "and back");

    const download = page.waitForEvent("download");
    await page.getByText("Save", { exact: true }).click();
    await page.getByText("PNG, as shown").click();
    const file = await (await download).path();
    assert.deepEqual([...readFileSync(file).subarray(1, 4)], [...Buffer.from("PNG")]);
    assert.deepEqual(faults, []);
    await page.close();
  } finally {
    await server.stop();
  }
});

test("a pixel is explained, and its sample is that of snell explain", {
  timeout: PATIENCE * 2,
}, async () => {
  const server = await serve("cornell-box", "--", "--spp", "8");
  try {
    const { page, faults } = await open(server.url);
    await isDone(page);
    const command = await copiedCommand(page);
    const box = await page.locator(".stage").boundingBox();
    await page.mouse.click(box.x + box.width / 2, box.y + box.height * 0.4);
    await page.getByRole("button", { name: "Why does it look so?" }).click();
    const dialog = page.locator(".explain");
    await dialog.locator("h2").waitFor();
    const [x, y] = (await dialog.locator("h2").innerText()).match(/\d+/g);
    assert.equal(await dialog.locator(".samples button").count(), 8);
    assert.equal(await dialog.locator(".trace").count(), 9, "every structure");
    await dialog.locator(".samples button").nth(3).click();
    await page.getByText("Path of sample 3").waitFor();
    const shown = await dialog.locator(".total code").innerText();
    // The same from the command line, with the camera and the size that the page has.
    const text = execFileSync(SNELL, [
      "explain",
      "cornell-box",
      "--pixel",
      `${x},${y}`,
      "--sample",
      "3",
      "--json",
      "--structures",
      "none",
      "--",
      ...command.slice(3),
    ]);
    const report = JSON.parse(text);
    const short = (v) =>
      v === 0 ? "0" : Math.abs(v) < 1e-4 ? v.toExponential(2) : Number(v.toPrecision(4)).toString();
    assert.equal(shown, `= ${report.tree.sum.map(short).join("  ")}`);
    await dialog.getByRole("button", { name: "Replay" }).click();
    await page.waitForFunction(() =>
      [...document.querySelectorAll(".trace small")].some((s) => /^step /.test(s.textContent)),
    );
    await page.getByRole("button", { name: "Close" }).click();
    await page.getByRole("button", { name: "Compare acceleration structures" }).click();
    await page.waitForFunction(() => document.querySelectorAll("canvas.heat").length === 9);
    await page.getByRole("button", { name: "Close" }).click();
    assert.deepEqual(faults, []);
    await page.close();
  } finally {
    await server.stop();
  }
});

test("without a scene there is a choice of scenes, with pictures", {
  timeout: PATIENCE * 2,
}, async () => {
  const server = await serve();
  try {
    const { page } = await open(server.url);
    await page.waitForFunction(() => document.querySelector(".card img")?.naturalWidth > 0);
    await page.locator(".card strong").getByText("teapot", { exact: true }).click();
    await page.waitForFunction(() => document.title.startsWith("teapot"));
    assert.equal(await page.locator(".gallery").count(), 0);
    await page.close();
  } finally {
    await server.stop();
  }
});

test("files are dropped, broken ones are a message, built-in scenes a choice", {
  timeout: PATIENCE * 2,
}, async () => {
  const server = await serve("cornell-box", "--", "--spp", "1");
  try {
    const { page } = await open(server.url);
    const mesh = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";
    await page.evaluate((text) => {
      const data = new DataTransfer();
      data.items.add(new File([text], "tetrahedron.off"));
      document
        .querySelector("main")
        .dispatchEvent(
          new DragEvent("drop", { dataTransfer: data, bubbles: true, cancelable: true }),
        );
    }, mesh);
    await page.waitForFunction(() => document.title.startsWith("tetrahedron"));
    await page.waitForFunction(() =>
      document.querySelector(".status").textContent.includes("4 triangles"),
    );
    await page.setInputFiles("input[type=file]", {
      name: "broken.ply",
      mimeType: "",
      buffer: Buffer.from("ply\nnonsense"),
    });
    await page.waitForFunction(() =>
      document.querySelector(".notices").textContent.includes("broken.ply"),
    );
    assert.match(await page.title(), /^tetrahedron/, "what was there still is");
    await page.locator(".menu summary").first().click();
    await page.getByRole("button", { name: "spheres", exact: true }).click();
    await page.waitForFunction(() => document.title.startsWith("spheres"));
    await page.close();
  } finally {
    await server.stop();
  }
});

test("one page steers, others watch and may take over", { timeout: PATIENCE * 2 }, async () => {
  const server = await serve("cornell-box", "--", "--spp", "1");
  try {
    const { page: first } = await open(server.url);
    const { page: second } = await open(server.url);
    await second.getByRole("button", { name: "Take over" }).click();
    await first.getByRole("button", { name: "Take over" }).waitFor();
    await isDone(second);
    const shown = await first.evaluate(() => document.querySelector("canvas").dataset.frame);
    await drag(second, 40, 0);
    await first.waitForFunction(
      (old) => document.querySelector("canvas").dataset.frame !== old,
      shown,
    );
    await second.close();
    await first.waitForFunction(
      () => !document.querySelector(".bar").textContent.includes("2 watch"),
    );
    await first.close();
  } finally {
    await server.stop();
  }
});

test("a picture that is slow to decode does not cover the one after it", {
  timeout: PATIENCE * 2,
}, async () => {
  const server = await serve("cornell-box", "--", "--spp", "1");
  try {
    const { page, faults } = await open(server.url, () => {
      const decode = window.createImageBitmap.bind(window);
      window.createImageBitmap = async (image) => {
        await new Promise((resolve) => setTimeout(resolve, 1000));
        return decode(image);
      };
    });
    await drag(page, 40, 0);
    await isDone(page);
    const last = () => page.evaluate(() => document.querySelector("canvas").dataset.kind);
    assert.equal(await last(), "half");
    await page.waitForTimeout(2000);
    assert.equal(await last(), "half", "no late one has come over it");
    assert.equal(await page.locator(".dot.done").count(), 1);
    assert.deepEqual(faults, []);
    await page.close();
  } finally {
    await server.stop();
  }
});

test("a page finds its server again after a restart", { timeout: PATIENCE * 2 }, async () => {
  const token = "0123456789abcdef0123456789abcdef";
  let server = await serve("cornell-box", "--token", token, "--", "--spp", "1");
  const port = new URL(server.url).port;
  const { page } = await open(server.url);
  try {
    await server.stop();
    await page.getByText("No connection to the server").waitFor();
    server = await serve("spheres", "--token", token, "--port", port, "--", "--spp", "1");
    await page.waitForFunction(() => document.title.startsWith("spheres"));
    await page.close();
  } finally {
    await server.stop();
  }
});

test("strangers are refused and nonsense does no harm", { timeout: PATIENCE * 2 }, async () => {
  const server = await serve("cornell-box", "--", "--spp", "1");
  try {
    const { host, origin } = new URL(server.url);
    assert.equal(await status(server.url, { host }), 200);
    assert.equal(await status(`${origin}/`, { host }), 403);
    assert.equal(await status(`${origin}/00000000000000000000000000000000/`, { host }), 403);
    assert.equal(await status(server.url, { host: "evil.example" }), 403);
    const upgrade = {
      connection: "upgrade",
      upgrade: "websocket",
      "sec-websocket-version": "13",
      "sec-websocket-key": "AAAAAAAAAAAAAAAAAAAAAA==",
    };
    assert.equal(
      await status(`${server.url}ws`, { host, origin: "http://evil.example", ...upgrade }),
      403,
    );

    const { page } = await open(server.url);
    await isDone(page);
    assert.equal(await status(`${server.url}save?format=exr/../..`, { host }), 400);
    const answers = await page.evaluate(async () => {
      const url = new URL("ws", document.baseURI).href.replace("http", "ws");
      const said = (messages) =>
        new Promise((resolve) => {
          const socket = new WebSocket(url);
          const errors = [];
          const end = (closed) => {
            socket.close();
            resolve({ errors, closed });
          };
          socket.onopen = () => {
            for (const message of messages) socket.send(message);
          };
          socket.onmessage = (e) => {
            if (typeof e.data !== "string") return;
            const message = JSON.parse(e.data);
            if (message.type !== "error") return;
            errors.push(message.message);
            if (errors.length === messages.length) end(false);
          };
          socket.onclose = () => end(true);
        });
      return {
        malformed: await said([
          "",
          "{",
          "[]",
          '{"type":"camera"}',
          '{"type":"pick"}',
          new Uint8Array(9),
        ]),
        oversized: await said(["x".repeat(3 << 20)]),
      };
    });
    assert.equal(answers.malformed.errors.length, 6, JSON.stringify(answers));
    assert.equal(answers.oversized.closed, true);
    // The page that behaves has noticed nothing.
    await drag(page, 30, 0);
    await isDone(page);
    await page.close();
  } finally {
    await server.stop();
  }
});
