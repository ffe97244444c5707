// The page without a server, in a real browser.

import assert from "node:assert/strict";
import { readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { test } from "node:test";
import { copiedCommand, drag, drop, fingerprint, folder, isDone, PATIENCE } from "../browser.mjs";
import { site } from "./server.mjs";
import { onAlone, rendered, sha256 } from "./site.mjs";

const SMALL = { width: 640, height: 320 };
const LIMIT = { timeout: PATIENCE * 3 };
const SPP = "&spp=4";

/** A square that is a glTF with its vertices in another file. */
const SQUARE = (() => {
  const bytes = Buffer.from(new Float32Array([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0]).buffer);
  const indices = Buffer.from(new Uint16Array([0, 1, 2, 0, 2, 3]).buffer);
  const gltf = {
    asset: { version: "2.0" },
    buffers: [{ uri: "parts/the%20square.bin", byteLength: 60 }],
    bufferViews: [
      { buffer: 0, byteLength: 48 },
      { buffer: 0, byteOffset: 48, byteLength: 12 },
    ],
    accessors: [
      {
        bufferView: 0,
        componentType: 5126,
        count: 4,
        type: "VEC3",
        min: [0, 0, 0],
        max: [1, 1, 0],
      },
      { bufferView: 1, componentType: 5123, count: 6, type: "SCALAR" },
    ],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 }, indices: 1 }] }],
    nodes: [{ mesh: 0 }],
    scenes: [{ nodes: [0] }],
  };
  return {
    "models/square.gltf": Buffer.from(JSON.stringify(gltf)),
    "models/parts/the square.bin": Buffer.concat([bytes, indices]),
  };
})();

for (const scene of ["cornell-box", "spheres", "fog", "prism", "hair"])
  test(`the picture of ${scene} at rest has the bits of snell render`, LIMIT, () =>
    onAlone(
      `#scene=${scene}${SPP}`,
      async (page) => {
        const found = await sha256(page);
        await isDone(page);
        const command = await copiedCommand(page);
        assert.ok(command.join(" ").includes("--spp 4"), command.join(" "));
        assert.equal(found, rendered(command));
      },
      { viewport: SMALL },
    ),
  );

test("a file from the disk is opened, edited, saved, and has the bits of its command", LIMIT, () =>
  onAlone(
    `#scene=spheres${SPP}`,
    async (page) => {
      const mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n";
      writeFileSync(join(folder, "corner.obj"), mesh);
      await drop(page, [["corner.obj", mesh]]);
      await page.getByText("corner", { exact: true }).first().waitFor();
      await drag(page, 50, 20);
      await page.waitForTimeout(500);
      await isDone(page);
      const command = await copiedCommand(page);
      assert.equal(await sha256(page), rendered(command, { cwd: folder }));
      const download = page.waitForEvent("download");
      await page.getByText("Save", { exact: true }).click();
      await page.getByText("PNG, as shown").click();
      const png = readFileSync(await (await download).path());
      assert.equal(png.toString("latin1", 1, 4), "PNG");
      await drop(page, [["broken.obj", "nonsense"]]);
      await page.locator(".notices", { hasText: "broken.obj" }).waitFor();
    },
    { viewport: SMALL },
  ),
);

test("a scene on the web is opened with the files that it names", LIMIT, () =>
  onAlone(
    `#scene=SITE/models/square.gltf${SPP}`,
    async (page) => {
      await page.getByText("square", { exact: true }).first().waitFor();
      await isDone(page);
      const words = await page.locator(".status").textContent();
      assert.match(words, /2 triangles/);
    },
    { files: SQUARE, viewport: SMALL },
  ),
);

test("an address that cannot be opened is named with the remedy", LIMIT, async () => {
  const other = await site(SQUARE);
  try {
    await onAlone(`#scene=${other.url}models/square.gltf`, async (page, served) => {
      await page.locator(".notices", { hasText: "Access-Control-Allow-Origin" }).waitFor();
      await page.goto(`${served.page}#scene=${served.url}nothing.glb`);
      await page.locator(".notices", { hasText: "answers 404" }).waitFor();
    });
  } finally {
    other.stop();
  }
});

test("a copied link shows the same view again", LIMIT, () =>
  onAlone(
    `#scene=spheres${SPP}`,
    async (page, served) => {
      await isDone(page);
      await drag(page, 80, 30);
      await page.waitForTimeout(500);
      await isDone(page);
      const [hash, shown] = [await sha256(page), await fingerprint(page)];
      await page.getByText("Save", { exact: true }).click();
      await page.getByText("Copy the link").click();
      await page.waitForFunction(() => document.location.hash.includes("camera="));
      const link = await page.evaluate(() => document.location.href);
      assert.ok(link.startsWith(`${served.page}#scene=spheres&`), link);
      await page.goto("about:blank");
      await page.goto(link);
      await page.waitForSelector("canvas[data-frame]");
      await page.waitForTimeout(1000);
      await isDone(page);
      assert.equal(await sha256(page), hash);
      assert.equal(await fingerprint(page), shown);
    },
    { viewport: SMALL },
  ),
);

test("a program that cannot be loaded is named, and loaded as soon as it can be", LIMIT, () =>
  onAlone(
    `#scene=spheres${SPP}`,
    async (page) => {
      let answer = { status: 404 };
      await page.route("**/snell.wasm.gz*", (route) =>
        answer ? route.fulfill(answer) : route.continue(),
      );
      await page.reload();
      await page.locator(".lost", { hasText: "answers 404" }).waitFor();
      answer = { body: "no program" };
      await page.locator(".lost", { hasText: "a fault in the renderer" }).waitFor();
      answer = null;
      await page.waitForSelector("canvas[data-frame]");
      assert.equal(await page.locator(".lost").count(), 0);
    },
    { viewport: SMALL },
  ),
);

test("without a link scenes are offered, with their pictures", LIMIT, () =>
  onAlone("", async (page) => {
    await page.locator(".card").first().waitFor();
    const broken = await page.locator(".card img").evaluateAll(async (images) => {
      for (const image of images) image.loading = "eager";
      const loads = images.map((image) =>
        image.decode().then(
          () => null,
          () => image.src,
        ),
      );
      return (await Promise.all(loads)).filter(Boolean);
    });
    assert.deepEqual(broken, []);
    await page.locator(".card strong").getByText("teapot", { exact: true }).click();
    await page.waitForFunction(() => document.title.startsWith("teapot"));
  }),
);

test("axe finds no fault in the page", LIMIT, () =>
  onAlone("", async (page) => {
    const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
    await page.evaluate(axe);
    const faults = () =>
      page.evaluate(async () =>
        (await window.axe.run()).violations.map(
          ({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html.slice(0, 120)).join(" | ")}`,
        ),
      );
    assert.deepEqual(await faults(), [], "with the scenes offered");
    await page.locator(".card strong").getByText("spheres", { exact: true }).click();
    await page.waitForFunction(() => document.title.startsWith("spheres"));
    assert.deepEqual(await faults(), [], "with a scene");
  }),
);
