// Measuring, cutting, drawing and comparing in a real browser, against the real server.

import assert from "node:assert/strict";
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import {
  choose,
  copiedCommand,
  drag,
  fingerprint,
  folder,
  isDone,
  isRenderedBy,
  onPage,
  PATIENCE,
  settled,
} from "./browser.mjs";

const WIDE = { width: 1200, height: 760 };
const started = (words, work, viewport = WIDE) => onPage(words, work, { viewport });
const NARROW = { width: 390, height: 780 };

const timeout = PATIENCE * 2;

/** A box of 2 x 3 x 4 with its middle at zero. */
const BOX = join(folder, "box.obj");
const corner = (i) => [(i & 1 ? 1 : -1) * 1, (i & 2 ? 1 : -1) * 1.5, (i & 4 ? 1 : -1) * 2];
const QUADS = [
  [0, 4, 6, 2],
  [1, 3, 7, 5],
  [0, 1, 5, 4],
  [2, 6, 7, 3],
  [0, 2, 3, 1],
  [4, 5, 7, 6],
];
writeFileSync(
  BOX,
  [...Array(8).keys()].map((i) => `v ${corner(i).join(" ")}\n`).join("") +
    QUADS.map((quad) => `f ${quad.map((i) => i + 1).join(" ")}\n`).join(""),
);

/** The camera of the picture, as the server has it. */
const cameraOf = (page) =>
  page.evaluate(
    () =>
      new Promise((resolve) => {
        const socket = new WebSocket(new URL("ws", document.baseURI).href.replace("http", "ws"));
        socket.onmessage = (event) => {
          const message = typeof event.data === "string" ? JSON.parse(event.data) : {};
          if (message.type !== "view") return;
          socket.close();
          resolve(message.view.camera);
        };
      }),
  );

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** The map from points of the world to positions on the page. */
async function sight(page) {
  const { eye, towards, up, projection } = await cameraOf(page);
  const box = await page.locator(".stage").boundingBox();
  const right = [
    towards[1] * up[2] - towards[2] * up[1],
    towards[2] * up[0] - towards[0] * up[2],
    towards[0] * up[1] - towards[1] * up[0],
  ];
  let [tx, ty] = projection.tan_half_fov;
  tx ??= (ty * box.width) / box.height;
  ty ??= (tx * box.height) / box.width;
  return (point) => {
    const d = point.map((v, i) => v - eye[i]);
    const depth = dot(d, towards);
    return [
      box.x + ((dot(d, right) / depth / tx + 1) / 2) * box.width,
      box.y + ((1 - dot(d, up) / depth / ty) / 2) * box.height,
    ];
  };
}

/** The choice of what the picture shows. */
const show = (page) => page.locator(".field", { hasText: /^Show/ }).locator("select");

/** The faces of the box: their middle, and how thick the box is below them. */
const FACES = [0, 1, 2].flatMap((axis) =>
  [-1, 1].map((side) => ({
    middle: [0, 1, 2].map((i) => (i === axis ? side * (2 + axis) * 0.5 : 0)),
    size: 2 + axis,
  })),
);

/** The faces that the camera sees. */
async function seenFaces(page) {
  const { eye } = await cameraOf(page);
  const faces = FACES.filter(({ middle }) => dot(middle, eye) > dot(middle, middle));
  assert.ok(faces.length >= 2, "two faces are seen");
  return faces;
}

test(
  "two clicks at corners measure the edge between them, exactly",
  {
    timeout: PATIENCE * 2,
  },
  () =>
    started([BOX, "--", "--spp", "1"], async (page) => {
      const place = await sight(page);
      const [face] = await seenFaces(page);
      // A corner of a face, and its neighbour on that face.
      const axis = face.middle.findIndex((v) => v !== 0);
      const along = [0, 1, 2].find((i) => i !== axis);
      const from = corner(7).map((v, i) => (i === axis ? face.middle[i] : v));
      const to = from.map((v, i) => (i === along ? -v : v));
      const inside = (p) => p.map((v, i) => (i === axis ? v : v * 0.985));
      await page.keyboard.press("m");
      await page.getByText("(0 of 2)").waitFor();
      await page.mouse.click(...place(inside(from)));
      await page.getByText("(1 of 2)").waitFor();
      await page.mouse.click(...place(inside(to)));
      await page.getByText("(0 of 2)").waitFor();
      const length = String(2 * Math.abs(from[along]));
      assert.equal(await page.locator(".overlay .label text").textContent(), length);
      assert.match(await page.locator(".palette li").innerText(), /d[xyz] -?[234]/);

      // Measures stay when the tool is put down, and move with the scene.
      await page.keyboard.press("Escape");
      assert.equal(await page.locator(".palette").count(), 0);
      const before = await page.locator(".overlay .label text").getAttribute("x");
      await drag(page, 50, 10);
      assert.notEqual(await page.locator(".overlay .label text").getAttribute("x"), before);
      await choose(page, "Tools", "Clear measures");
      assert.equal(await page.locator(".overlay .label").count(), 0);
    }),
);

test(
  "a wall has its thickness, two faces their angle, three points theirs",
  {
    timeout: PATIENCE * 2,
  },
  () =>
    started([BOX, "--", "--spp", "1"], async (page) => {
      const place = await sight(page);
      const [first, second] = await seenFaces(page);
      await choose(page, "Tools", "Measure");
      await page.getByRole("button", { name: "Thickness" }).click();
      await page.mouse.click(...place(first.middle));
      await page.getByRole("button", { name: `copy thickness ${first.size}` }).waitFor();
      await page.getByRole("button", { name: "Faces" }).click();
      await page.mouse.click(...place(first.middle));
      await page.getByText("(1 of 2)").waitFor();
      await page.mouse.click(...place(second.middle));
      await page.getByRole("button", { name: "copy faces 90°" }).waitFor();
      await page.getByRole("button", { name: "Angle" }).click();
      const axis = first.middle.findIndex((v) => v !== 0);
      const [a, b] = [0, 1, 2].filter((i) => i !== axis);
      const off = (du, dv) => first.middle.map((v, i) => (i === a ? du : i === b ? dv : v));
      for (const [at, left] of [
        [off(0.5, 0), "(1 of 3)"],
        [off(0, 0), "(2 of 3)"],
        [off(0, 0.5), "(0 of 3)"],
      ]) {
        await page.mouse.click(...place(at));
        await page.getByText(left).waitFor();
      }
      const angle = await page.locator(".palette li").last().locator("strong").innerText();
      assert.ok(Math.abs(Number.parseFloat(angle) - 90) < 1, angle);
      await page.evaluate(() =>
        Object.defineProperty(navigator, "clipboard", {
          value: { writeText: async (text) => (window.copied = text) },
        }),
      );
      await page.getByRole("button", { name: "Copy all" }).click();
      const copied = await page.evaluate(() => window.copied);
      assert.equal(copied.split("\n").length, 3);
      assert.ok(copied.startsWith(`thickness\t${first.size}\t`), copied);
      await page.getByRole("button", { name: "Clear all" }).click();
      assert.equal(await page.locator(".overlay .label").count(), 0);
    }),
);

test(
  "a section shows the inside, moving and at rest, and the command cuts the same",
  {
    timeout: PATIENCE * 3,
  },
  () =>
    started(["cornell-box", "--", "--spp", "2"], async (page) => {
      const whole = await fingerprint(page);
      await choose(page, "Tools", "Section");
      await page.getByRole("button", { name: "section across Z" }).click();
      await page.getByLabel("place of the section, in units of the scene").fill("150");
      await page.keyboard.press("Tab");
      await page.waitForTimeout(400);
      await isDone(page);
      const cut = await fingerprint(page);
      assert.notEqual(cut, whole);
      await isRenderedBy(await copiedCommand(page), page);
      // What is picked is what is seen behind the plane.
      const box = await page.locator(".stage").boundingBox();
      await page.mouse.click(box.x + box.width / 2, box.y + box.height * 0.8);
      await page.locator(".facts").waitFor();
      const facts = await page.locator(".facts").innerText();
      const [, , z] = facts
        .match(/Position\s+(\S+), (\S+), (\S+)/)
        .slice(1)
        .map(Number);
      assert.ok(z >= 150 - 1e-3, facts);
      await page.getByRole("button", { name: "Flip" }).click();
      await page.waitForTimeout(400);
      await isDone(page);
      assert.notEqual(await fingerprint(page), cut);
      await page.getByRole("button", { name: "Off" }).click();
      assert.equal(await settled(page, whole), whole, "without it everything is as it was");
    }),
);

test("a section is put on a face and moved inwards", { timeout: PATIENCE * 2 }, () =>
  started([BOX, "--", "--spp", "1"], async (page) => {
    const place = await sight(page);
    const [face] = await seenFaces(page);
    await choose(page, "Tools", "Section");
    await page.getByRole("button", { name: "Face", exact: true }).click();
    await page.mouse.click(...place(face.middle));
    const field = page.getByLabel("place of the section, in units of the scene");
    // Until then it is the section through the middle.
    await page.waitForFunction(
      ([label, wanted]) =>
        Number(document.querySelector(`input[aria-label="${label}"]`)?.value) === wanted,
      ["place of the section, in units of the scene", face.size / 2],
    );
    await field.fill("0");
    await page.keyboard.press("Tab");
    await page.waitForTimeout(400);
    await isDone(page);
    // The middle of the face is cut away: the inside of the opposite one is seen.
    await page.mouse.click(...place(face.middle.map((v) => v * 0.2)));
    await page.locator(".facts").waitFor();
  }),
);

test(
  "an EXR of the picture itself has no difference, another one has, in FLIP and in numbers",
  {
    timeout: PATIENCE * 3,
  },
  () =>
    started(["cornell-box", "--", "--spp", "4"], async (page) => {
      const saved = async (format) =>
        Buffer.from(
          await page.evaluate(
            async (f) => [...new Uint8Array(await (await fetch(`save?format=${f}`)).arrayBuffer())],
            format,
          ),
        );
      const field = page.getByLabel("picture to compare with");
      await field.setInputFiles({ name: "same.exr", mimeType: "", buffer: await saved("exr") });
      await page.getByRole("button", { name: "Difference" }).click();
      const said = page.getByTestId("difference");
      await page.waitForFunction(() =>
        document.querySelector("[data-testid=difference]")?.textContent.startsWith("mean FLIP"),
      );
      assert.match(await said.innerText(), /^mean FLIP 0 · MSE [\d.e-]+ · relative MSE/);

      // The same wall in another colour.
      await page.getByLabel("Exposure (stops)").last().fill("1");
      await page.keyboard.press("Tab");
      await page.waitForTimeout(300);
      const brighter = await saved("png");
      await page.getByLabel("Exposure (stops)").last().fill("0");
      await page.keyboard.press("Tab");
      await field.setInputFiles({ name: "brighter.png", mimeType: "", buffer: brighter });
      await page.waitForFunction(() => {
        const text = document.querySelector("[data-testid=difference]")?.textContent ?? "";
        return /^mean FLIP 0\.\d*[1-9]/.test(text);
      });
      await page.getByLabel("measure of the difference").selectOption("relative");
      await page.waitForFunction(() =>
        document
          .querySelector("[data-testid=difference]")
          ?.textContent.startsWith("mean relative error"),
      );
      const box = await page.locator(".stage").boundingBox();
      await page.mouse.move(box.x + box.width / 2, box.y + box.height * 0.6);
      const readout = await page.getByTestId("readout").innerText();
      const values = (name) =>
        readout
          .match(new RegExp(`${name}\\s+(\\S+)\\s+(\\S+)\\s+(\\S+)`))
          .slice(1)
          .map(Number);
      const [mine, theirs, less] = ["picture", "reference", "difference"].map(values);
      assert.ok(theirs[0] > mine[0], readout);
      assert.ok(Math.abs(mine[0] - theirs[0] - less[0]) < 0.01, readout);

      // Flip: the reference comes with a key, and goes when it is let go.
      await page.getByRole("button", { name: "Flip", exact: true }).click();
      const isShown = () =>
        page.evaluate(() => getComputedStyle(document.querySelector("canvas.compared")).display);
      await page.mouse.move(box.x + 5, box.y + 5);
      await page.keyboard.down("b");
      await page.waitForTimeout(50);
      assert.equal(await isShown(), "block");
      await page.keyboard.up("b");
      await page.waitForTimeout(50);
      assert.equal(await isShown(), "none");
      await page.getByRole("button", { name: "end the comparison" }).click();
      assert.equal(await page.getByRole("button", { name: "Difference" }).count(), 0);
    }),
);

test("a wipe has the reference on its left, a flip shows it whole", { timeout }, () =>
  started(["cornell-box", "--", "--spp", "1"], async (page) => {
    // Nothing but red, in the size of the picture.
    const red = await page.evaluate(async () => {
      const canvas = document.createElement("canvas");
      const { width, height } = document.querySelector("canvas.picture");
      Object.assign(canvas, { width, height });
      const context = canvas.getContext("2d");
      context.fillStyle = "#f00";
      context.fillRect(0, 0, width, height);
      const blob = await new Promise((resolve) => canvas.toBlob(resolve));
      return [...new Uint8Array(await blob.arrayBuffer())];
    });
    const file = { name: "red.png", mimeType: "image/png", buffer: Buffer.from(red) };
    await page.getByLabel("picture to compare with").setInputFiles(file);
    await page.locator(".split").waitFor();
    const box = await page.locator(".stage").boundingBox();
    /** True where the page shows the reference. */
    const isRed = async (x) => {
      const clip = { x: box.x + box.width * x, y: box.y + box.height / 3, width: 1, height: 1 };
      const shot = (await page.screenshot({ clip })).toString("base64");
      const [r, g, b] = await page.evaluate(async (png) => {
        const image = new Image();
        image.src = `data:image/png;base64,${png}`;
        await image.decode();
        const context = document.createElement("canvas").getContext("2d");
        context.drawImage(image, 0, 0);
        return [...context.getImageData(0, 0, 1, 1).data];
      }, shot);
      return r > 250 && g < 5 && b < 5;
    };
    const seen = async () => [await isRed(0.3), await isRed(0.6)];
    assert.deepEqual(await seen(), [true, false]);
    await page.locator(".split").fill("80");
    assert.deepEqual(await seen(), [true, true]);
    await page.locator(".split").fill("10");
    assert.deepEqual(await seen(), [false, false]);
    await page.getByRole("button", { name: "Flip" }).click();
    assert.deepEqual(await seen(), [false, false]);
    await page.keyboard.down("b");
    assert.deepEqual(await seen(), [true, true]);
    await page.keyboard.up("b");
    assert.deepEqual(await seen(), [false, false]);
    await page.getByRole("button", { name: "end the comparison" }).click();
    assert.equal(await page.locator(".split").count(), 0);
  }),
);

test(
  "a file that is no picture is said to be none, and the comparison stays as it was",
  {
    timeout: PATIENCE * 2,
  },
  () =>
    started(["cornell-box", "--", "--spp", "1"], async (page) => {
      await page.keyboard.press("c");
      await page.getByText("kept, 1 sample").waitFor();
      await page
        .getByLabel("picture to compare with")
        .setInputFiles({ name: "odd.exr", mimeType: "", buffer: Buffer.from("nonsense") });
      await page.locator(".notices", { hasText: "odd.exr" }).waitFor();
      assert.equal(await page.getByText("kept, 1 sample").count(), 1);
    }),
);

test(
  "depth has a legend with its range, ids have their name under the pointer",
  {
    timeout: PATIENCE * 3,
  },
  () =>
    started(["cornell-box", "--", "--spp", "1"], async (page) => {
      await show(page).selectOption("depth");
      const low = page.getByLabel("lower end of the colours");
      await low.waitFor();
      const [near, far] = [
        Number(await low.inputValue()),
        Number(await page.getByLabel("upper end of the colours").inputValue()),
      ];
      // The opening of the box is 800 away from the eye, its back wall 1359.2.
      assert.ok(near > 700 && near < 900 && Math.abs(far - 1359.2) < 2, `${near} ${far}`);
      await page.getByLabel("colour map").selectOption("viridis");
      const box = await page.locator(".stage").boundingBox();
      await page.mouse.move(box.x + box.width / 2, box.y + box.height * 0.4);
      await page.waitForFunction(() =>
        /depth 1[23]\d\d/.test(document.querySelector("[data-testid=readout]").textContent),
      );
      await show(page).selectOption("material-id");
      await page.waitForFunction(() => {
        const text = document.querySelector("[data-testid=readout]").textContent;
        return /material-id 0 \(white\)/.test(text);
      });
      assert.equal(await low.count(), 0, "ids have no range");
    }),
);

test("edges, axes and grid are drawn, and follow the camera", { timeout: PATIENCE * 2 }, () =>
  started([BOX, "--", "--spp", "1"], async (page) => {
    for (const name of ["Edges", "Axes", "Grid"]) await choose(page, "Tools", name);
    await page.waitForFunction(
      () => Number(document.querySelector("canvas.edges").dataset.lines) > 500,
    );
    assert.equal(await page.locator(".overlay .axes text").count(), 3);
    assert.ok((await page.locator(".overlay .grid line").count()) > 20);
    assert.match(await page.locator(".overlay .grid").textContent(), /one cell: 0\.5/);
    const lines = () => page.evaluate(() => document.querySelector("canvas.edges").dataset.lines);
    const [before, axis] = [
      await lines(),
      await page.locator(".overlay .axes g line").first().getAttribute("x2"),
    ];
    await drag(page, 80, 20);
    assert.notEqual(await page.locator(".overlay .axes g line").first().getAttribute("x2"), axis);
    await isDone(page);
    await page.waitForFunction(
      (old) => document.querySelector("canvas.edges").dataset.lines !== old,
      before,
    );
    await choose(page, "Tools", "Edges");
    assert.equal(await page.locator("canvas.edges").isVisible(), false);
  }),
);

test("the histogram counts every pixel, by stops or by value", { timeout: PATIENCE * 2 }, () =>
  started(["cornell-box", "--", "--spp", "1"], async (page) => {
    await page.keyboard.press("h");
    const palette = page.getByRole("region", { name: "histogram" });
    assert.equal(await palette.locator("path").count(), 4);
    const first = await palette.locator("path.luminance").getAttribute("d");
    await palette.getByRole("button", { name: "Logarithmic" }).click();
    assert.notEqual(await palette.locator("path.luminance").getAttribute("d"), first);
    await page.keyboard.press("h");
    assert.equal(await palette.count(), 0);
  }),
);

test(
  "on a phone every tool fits, has a name and can be touched",
  {
    timeout: PATIENCE * 2,
  },
  () =>
    started(
      ["cornell-box", "--", "--spp", "1"],
      async (page) => {
        await choose(page, "Tools", "Measure");
        await choose(page, "Tools", "Section");
        await page.getByRole("button", { name: "section across X" }).click();
        await choose(page, "Tools", "Histogram");
        await page.keyboard.press("c");
        await page.getByRole("button", { name: "Difference" }).click();
        const faults = await page.evaluate(() => {
          const found = [];
          for (const control of document.querySelectorAll(
            ".palettes button, .palettes input, .palettes select",
          )) {
            const name = control.getAttribute("aria-label") ?? control.textContent.trim();
            const { width, height, left, right } = control.getBoundingClientRect();
            if (!name) found.push(`${control.outerHTML} has no name`);
            if (width < 40 || height < 40) found.push(`${name}: ${width} x ${height}`);
            if (left < 0 || right > innerWidth) found.push(`${name} is outside`);
          }
          if (document.documentElement.scrollWidth > innerWidth) found.push("the page is too wide");
          return found;
        });
        assert.deepEqual(faults, []);
      },
      NARROW,
    ),
);
