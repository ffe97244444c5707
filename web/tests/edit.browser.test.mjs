// Changing the scene on the page, in a real browser against the real server: forms, materials,
// drops, surroundings, selection, lights, textures, motion. SNELL and CHROME name the programs.

import assert from "node:assert/strict";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { fileURLToPath } from "node:url";
import {
  copiedCommand,
  drop,
  folder,
  isDone,
  isRenderedBy,
  middle,
  PATIENCE,
  section,
  unfold,
  onPage as within,
} from "./browser.mjs";

const timeout = PATIENCE * 2;
const sample = (name) => fileURLToPath(new URL(`../../scenes/${name}`, import.meta.url));

const onPage = (name, words, check, viewport) =>
  test(name, { timeout }, () => within(words, check, { viewport }));

/** A file in the folder of the tests. */
function file(name, content) {
  const path = join(folder, name);
  mkdirSync(join(path, ".."), { recursive: true });
  writeFileSync(path, content);
  return path;
}

const TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
/** A triangle that moves to the right in a second, as glTF. */
const number = (values) => Buffer.from(new Float32Array(values).buffer);
const MOTION = Buffer.concat([
  number([0, 0, 0, 1, 0, 0, 0, 1, 0]),
  number([0, 1]),
  number([0, 0, 0, 1, 0, 0]),
]);
file(
  "moving.gltf",
  JSON.stringify({
    asset: { version: "2.0" },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ name: "slider", mesh: 0 }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 } }] }],
    buffers: [
      {
        byteLength: MOTION.length,
        uri: `data:application/octet-stream;base64,${MOTION.toString("base64")}`,
      },
    ],
    bufferViews: [
      { buffer: 0, byteOffset: 0, byteLength: 36 },
      { buffer: 0, byteOffset: 36, byteLength: 8 },
      { buffer: 0, byteOffset: 44, byteLength: 24 },
    ],
    accessors: [
      {
        bufferView: 0,
        componentType: 5126,
        count: 3,
        type: "VEC3",
        min: [0, 0, 0],
        max: [1, 1, 0],
      },
      { bufferView: 1, componentType: 5126, count: 2, type: "SCALAR", min: [0], max: [1] },
      { bufferView: 2, componentType: 5126, count: 2, type: "VEC3" },
    ],
    animations: [
      {
        name: "slide",
        samplers: [{ input: 1, output: 2 }],
        channels: [{ sampler: 0, target: { node: 0, path: "translation" } }],
      },
    ],
  }),
);
/** A PNG of one red pixel. */
const RED = Buffer.from(
  "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGP4z8AAAAMBAQDJ/pLvAAAAAElFTkSuQmCC",
  "base64",
);
/** A Radiance picture of two by one pixels, blue and red. */
const HDR = Buffer.concat([
  Buffer.from("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n"),
  Buffer.from([0, 0, 128, 129, 128, 0, 0, 129]),
]);

/** Does something, and waits for the picture at rest that comes of it. */
async function changing(page, change) {
  const frame = () => page.evaluate(() => document.querySelector("canvas.picture").dataset.frame);
  const before = await frame();
  await change();
  await page.waitForFunction(
    (old) => document.querySelector("canvas.picture").dataset.frame !== old,
    before,
  );
  // The numbers below the picture follow the frame.
  await page.waitForTimeout(100);
  await isDone(page);
}

/** Selects what is below the middle of the picture, and puts the handles on it. */
async function carry(page) {
  const [x, y] = await middle(page);
  await page.mouse.click(x, y + 20);
  await page.waitForSelector(".overlay .outline");
  await page.getByRole("button", { name: "Move", exact: true }).click();
}

const undoIs = (page, enabled) =>
  page.waitForSelector(`button:has-text("Undo"):${enabled ? "enabled" : "disabled"}`);

/** A point of the picture in display values. */
const colorAt = (page, x, y) =>
  page.evaluate(
    ([u, v]) => {
      const canvas = document.querySelector("canvas.picture");
      const at = [Math.floor(canvas.width * u), Math.floor(canvas.height * v)];
      return [
        ...canvas
          .getContext("2d")
          .getImageData(...at, 1, 1)
          .data.slice(0, 3),
      ];
    },
    [x, y],
  );

for (const [width, height] of [
  [1280, 800],
  [390, 780],
]) {
  onPage(
    `nothing in the panel is cut off at ${width} pixels`,
    ["spheres", "--", "--spp", "1"],
    async (page) => {
      if (
        await page
          .locator(".panel")
          .count()
          .then((n) => n === 0)
      )
        await page.getByRole("button", { name: "Panel" }).click();
      for (const title of ["Materials", "Lights", "Surroundings", "Picture", "Camera"])
        await unfold(page, title);
      const cut = await page.evaluate(() => {
        const panel = document.querySelector(".panel").getBoundingClientRect();
        return [...document.querySelectorAll(".panel input, .panel select, .panel button")]
          .filter((e) => e.checkVisibility())
          .map((e) => [e.getAttribute("aria-label") ?? e.textContent, e.getBoundingClientRect()])
          .filter(([, box]) => box.right > panel.right + 1 || box.left < panel.left - 1)
          .map(([name]) => name);
      });
      assert.deepEqual(cut, []);
    },
    { width, height },
  );
}

onPage(
  "an emptied field goes back to its default, never to zero",
  ["spheres", "--", "--spp", "1"],
  async (page) => {
    const materials = await unfold(page, "Materials");
    const glass = await materials
      .getByLabel("Which")
      .evaluate((s) => [...s.options].find((o) => o.text.includes("glass"))?.value);
    await materials.getByLabel("Which").selectOption(glass);
    const ior = materials.getByLabel("ior", { exact: true }).last();
    await ior.fill("2.5");
    await ior.press("Tab");
    await undoIs(page, true);
    await ior.fill("");
    await ior.press("Tab");
    await page.waitForFunction(
      () => [...document.querySelectorAll('[aria-label="ior"]')].at(-1).value === "1.5",
    );
    const share = materials.getByLabel("tint red");
    await share.fill("");
    await share.press("Tab");
    assert.equal(await share.inputValue(), "1");
    // A number out of its range is the nearest in it.
    await share.fill("7");
    await share.press("Tab");
    assert.equal(await share.inputValue(), "1");
  },
);

onPage(
  "a kind is chosen from a list, and the colour stays",
  ["cornell-box", "--", "--spp", "1"],
  async (page) => {
    const materials = await unfold(page, "Materials");
    const red = await materials
      .getByLabel("Which")
      .evaluate((s) => [...s.options].find((o) => o.text === "red").value);
    await materials.getByLabel("Which").selectOption(red);
    const before = await materials.getByLabel("reflectance red").inputValue();
    await changing(page, () => materials.getByLabel("Kind").selectOption("open-pbr"));
    await materials.getByLabel("base color red").waitFor();
    assert.equal(await materials.getByLabel("base color red").inputValue(), before);
    await isRenderedBy(await copiedCommand(page), page);
  },
);

onPage(
  "a bare mesh gets a material by one click, its colour first, and undo takes it back",
  [file("bare.obj", TRIANGLE), "--", "--spp", "1"],
  async (page) => {
    await page.getByRole("button", { name: "Give it a material" }).click();
    const material = section(page, "Material").first();
    await material.getByLabel("base color", { exact: true }).waitFor();
    const first = material.locator("input[type=color], input[type=range]").first();
    assert.equal(await first.getAttribute("aria-label"), "base color");
    await changing(page, async () => {
      await material.getByLabel("base color green").fill("0");
      await material.getByLabel("base color green").press("Tab");
    });
    await isRenderedBy(await copiedCommand(page), page);
    await page.getByText("Undo", { exact: true }).click();
    await page.getByText("Undo", { exact: true }).click();
    await page.getByRole("button", { name: "Give it a material" }).waitFor();
  },
);

onPage(
  "a scene is dropped with its files, and names only those",
  ["cornell-box", "--", "--spp", "1"],
  async (page) => {
    const gltf = readFileSync(sample("pyramid.gltf"));
    await drop(page, [
      ["house.mtl", "newmtl paint\nKd 0.1 0.2 0.7\n"],
      ["house.obj", `mtllib house.mtl\nusemtl paint\n${TRIANGLE}`],
    ]);
    await page.waitForFunction(() => document.title.startsWith("house"));
    await page.waitForFunction(() =>
      document.querySelector(".panel").textContent.includes("paint"),
    );
    await drop(page, [["pyramid.gltf", gltf]]);
    await page.waitForFunction(() => document.title.startsWith("pyramid"));
  },
);

onPage(
  "a folder is dropped with all that is in it",
  ["cornell-box", "--", "--spp", "1"],
  async (page) => {
    await page.evaluate((mesh) => {
      const fileEntry = (path, text) => ({
        name: path.split("/").at(-1),
        fullPath: path,
        isDirectory: false,
        file: (done) => done(new File([text], path.split("/").at(-1))),
      });
      const folder = (path, children) => ({
        name: path.split("/").at(-1),
        fullPath: path,
        isDirectory: true,
        createReader: () => {
          const parts = [children, []];
          return { readEntries: (done) => done(parts.shift()) };
        },
      });
      const shed = folder("/shed", [
        fileEntry("/shed/shed.obj", `mtllib parts/shed.mtl\nusemtl tin\n${mesh}`),
        fileEntry("/shed/.DS_Store", "x"),
        folder("/shed/parts", [fileEntry("/shed/parts/shed.mtl", "newmtl tin\nKd 1 0 0\n")]),
      ]);
      const event = new DragEvent("drop", { bubbles: true, cancelable: true });
      const items = [{ webkitGetAsEntry: () => shed }];
      Object.defineProperty(event, "dataTransfer", { value: { files: [], items } });
      document.querySelector("main").dispatchEvent(event);
    }, TRIANGLE);
    await page.waitForFunction(() => document.title.startsWith("shed"));
    await page.waitForFunction(() =>
      document.querySelector(".panel").textContent.includes("Material: tin"),
    );
  },
);

onPage(
  "what cannot be read leaves the scene, and is said in words of the page",
  ["spheres", "--", "--spp", "1"],
  async (page) => {
    const said = page.locator(".notices");
    const text = async (part) => {
      await page.waitForFunction(
        (p) => document.querySelector(".notices").textContent.includes(p),
        part,
      );
      return said.innerText();
    };
    const lone = JSON.parse(readFileSync(join(folder, "moving.gltf"), "utf8"));
    lone.buffers[0].uri = "b.bin";
    await drop(page, [["a.gltf", JSON.stringify(lone)]]);
    const lacking = await text("b.bin");
    assert.match(lacking, /drop it together with the files that it names/);
    await drop(page, [["notes.txt", "hello"]]);
    const unknown = await text("notes.txt");
    assert.doesNotMatch(unknown, /`snell|--/);
    await drop(page, [["photo.png", RED]]);
    await text("a picture is dropped on a parameter");
    assert.match(await page.title(), /^spheres/);
  },
);

onPage(
  "files that are too large are refused before they are sent",
  ["spheres", "--", "--spp", "1"],
  async (page) => {
    let posts = 0;
    page.on("request", (request) => (posts += Number(request.method() === "POST")));
    await page.evaluate(() => {
      const big = new File(["x"], "big.obj");
      Object.defineProperty(big, "size", { value: 300 << 20 });
      const event = new DragEvent("drop", { bubbles: true, cancelable: true });
      const items = [];
      Object.defineProperty(event, "dataTransfer", { value: { files: [big], items } });
      document.querySelector("main").dispatchEvent(event);
    });
    await page.getByText("too much to send").waitFor();
    assert.equal(posts, 0);
  },
);

onPage(
  "a picture that is dropped lights the scene, is turned, and the command makes the same",
  ["spheres", "--", "--spp", "1"],
  async (page) => {
    const light = file("evening.hdr", HDR);
    await drop(page, [["evening.hdr", readFileSync(light)]]);
    const around = section(page, "Surroundings").first();
    await around.getByLabel("Rotation (°)").last().waitFor();
    await around.getByLabel("Rotation (°)").last().fill("90");
    await around.getByLabel("Rotation (°)").last().press("Tab");
    await changing(page, async () => {
      await around.getByLabel("Strength").last().fill("2");
      await around.getByLabel("Strength").last().press("Tab");
    });
    await isRenderedBy(await copiedCommand(page), page, { cwd: folder });
    assert.match(
      await section(page, "Warnings").first().textContent(),
      /evening.hdr was dropped here: run the command/,
    );
    await page.getByText("Undo", { exact: true }).click();
  },
);

onPage(
  "the background is the environment, a colour, a shadow on a floor, or transparent",
  ["spheres", "--", "--spp", "1"],
  async (page) => {
    const around = await unfold(page, "Surroundings");
    for (const [kind, check] of [
      ["color", async () => around.getByLabel("behind", { exact: true }).waitFor()],
      ["studio", async () => around.getByLabel("behind", { exact: true }).waitFor()],
      ["transparent", async () => {}],
    ]) {
      await changing(page, () => around.getByLabel("Background").selectOption(kind));
      await page.waitForFunction(
        (k) => document.querySelector('select[aria-label="Background"]').value === k,
        kind,
      );
      await check();
    }
    await isDone(page);
    await isRenderedBy(await copiedCommand(page), page);
  },
);

onPage(
  "what is picked has an outline at rest and a box while it moves, and can be isolated and back",
  ["spheres", "--", "--spp", "1"],
  async (page) => {
    const [x, y] = await middle(page);
    const before = await colorAt(page, 0.05, 0.05);
    await page.mouse.click(x, y + 20);
    await page.waitForSelector(".overlay .outline");
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x + 40, y + 5, { steps: 4 });
    await page.waitForSelector(".overlay .box line");
    await page.mouse.up();
    await page.waitForSelector(".overlay .outline");
    await changing(page, () => page.getByRole("button", { name: "Isolate" }).click());
    await page.waitForSelector('button[aria-pressed="true"]:has-text("Isolate")');
    await isRenderedBy(await copiedCommand(page), page);
    await page.getByRole("button", { name: "Isolate" }).click();
    await page.waitForSelector('button[aria-pressed="false"]:has-text("Isolate")');
    assert.equal(before.length, 3);
  },
);

onPage(
  "an arrow moves the selection, one gesture is one step, and the command makes the same picture",
  ["spheres", "--", "--spp", "1"],
  async (page) => {
    await carry(page);
    const tip = page.locator('.gizmo .axis[data-axis="x"] circle');
    const box = await tip.boundingBox();
    const start = [box.x + box.width / 2, box.y + box.height / 2];
    await page.mouse.move(...start);
    await page.waitForSelector(".gizmo .axis.active");
    await page.mouse.down();
    for (let i = 1; i <= 6; i++) {
      await page.mouse.move(start[0] + 8 * i, start[1]);
      await page.waitForTimeout(250);
    }
    await changing(page, () => page.mouse.up());
    const moved = await copiedCommand(page);
    assert.ok(
      moved.some((word) => /^node\.\d+\.transform=/.test(word)),
      moved.join(" "),
    );
    await isRenderedBy(moved, page);
    await page.keyboard.press("Escape");
    assert.equal(await page.locator(".gizmo").count(), 0);
    await page.getByText("Undo", { exact: true }).click();
    await undoIs(page, false);
  },
);

onPage(
  "a ring turns the selection, a square moves it in a plane",
  ["spheres", "--", "--spp", "1"],
  async (page) => {
    await carry(page);
    /** Drags a handle, and gives the transform of the node after it. */
    const dragged = async (kind, axis) => {
      const handle = `.gizmo .${kind}[data-axis="${axis}"]`;
      await page.waitForSelector(handle, { state: "attached" });
      const [from, by] = await page.evaluate((selector) => {
        const line = document.querySelector(`${selector} polyline`);
        const { a, b, c, d, e, f } = line.getScreenCTM();
        const middle = line.points[Math.floor(line.points.length / 3)];
        const at = [a * middle.x + c * middle.y + e, b * middle.x + d * middle.y + f];
        return [at, [30, 12]];
      }, handle);
      await page.mouse.move(...from);
      await page.waitForSelector(`${handle}.active`);
      await page.mouse.down();
      await page.mouse.move(from[0] + by[0] / 2, from[1] + by[1] / 2);
      await page.waitForTimeout(100);
      await page.mouse.move(from[0] + by[0], from[1] + by[1]);
      await changing(page, () => page.mouse.up());
      const said = await copiedCommand(page);
      const word = said.find((w) => /^node\.\d+\.transform=/.test(w));
      assert.ok(word, said.join(" "));
      return JSON.parse(word.split("=")[1]);
    };
    const first = await dragged("plane", "y");
    const moved = await dragged("plane", "y");
    const by = moved.map((row, i) => row[3] - first[i][3]);
    assert.ok(Math.abs(by[1]) < 1e-6 && Math.hypot(by[0], by[2]) > 1e-3, `${by}`);
    const turned = await dragged("ring", "y");
    const size = (rows) => Math.hypot(rows[0][0], rows[2][0]);
    assert.ok(Math.abs(turned[0][0] - moved[0][0]) > 1e-3, `${turned}`);
    assert.ok(Math.abs(size(turned) - size(moved)) < 1e-5, "it is as large as before");
    assert.ok(
      turned[1].every((value, i) => Math.abs(value - moved[1][i]) < 1e-5),
      `${turned}`,
    );
    for (let i = 0; i < 3; i++) await page.getByText("Undo", { exact: true }).click();
    await undoIs(page, false);
  },
);

onPage(
  "a light is added, changes its kind, moves, and undo takes it back",
  ["cornell-box", "--", "--spp", "1"],
  async (page) => {
    const lights = await unfold(page, "Lights");
    await changing(page, () => lights.getByLabel("Add a light").selectOption("point"));
    await changing(page, () => lights.getByLabel("Kind").selectOption("spot"));
    await lights.getByLabel("direction x").waitFor();
    await lights.getByRole("button", { name: "Move it" }).click();
    await page.waitForSelector(".gizmo .ring", { state: "attached" });
    await page.keyboard.press("Escape");
    await isRenderedBy(await copiedCommand(page), page);
    await page.getByText("Undo", { exact: true }).click();
    await page.getByText("Undo", { exact: true }).click();
    await page.waitForFunction(() => document.body.textContent.includes("Lights (0)"));
  },
);

onPage(
  "a picture is dropped on a parameter as its texture, and a pattern is chosen",
  [file("sheet.obj", TRIANGLE), "--", "--spp", "1"],
  async (page) => {
    file("red.png", RED);
    await page.getByRole("button", { name: "Give it a material" }).click();
    await page.getByLabel("texture of base color").waitFor();
    await changing(page, () =>
      drop(page, [["red.png", RED]], 'fieldset.slot[aria-label="base color: texture"]'),
    );
    await page.waitForFunction(
      () =>
        document.querySelector('fieldset.slot[aria-label="base color: texture"] img')
          ?.naturalWidth > 0,
    );
    await isDone(page);
    await isRenderedBy(await copiedCommand(page), page, { cwd: folder });
    await page.getByLabel("texture of specular roughness", { exact: true }).click();
    await changing(page, () =>
      page.getByLabel("pattern of specular roughness", { exact: true }).selectOption({ index: 1 }),
    );
    await page.waitForFunction(
      () =>
        document.querySelector('fieldset.slot[aria-label="specular roughness: texture"] img')
          ?.naturalWidth > 0,
    );
    await isDone(page);
    await isRenderedBy(await copiedCommand(page), page, { cwd: folder });
  },
);

onPage(
  "a scene that moves is played, scrubbed, and the command makes the moment",
  [sample("pyramid.gltf"), "--", "--spp", "1"],
  async (page) => {
    assert.equal(await page.locator(".animation").count(), 0, "nothing moves");
    const moving = readFileSync(join(folder, "moving.gltf"));
    await drop(page, [["moving.gltf", moving]]);
    await page.getByRole("button", { name: "Play" }).click();
    const time = () => page.getByLabel("time in seconds").inputValue();
    const first = await time();
    await page.waitForFunction(
      (t) => document.querySelector('[aria-label="time in seconds"]').value !== t,
      first,
    );
    await page.getByRole("button", { name: "Pause" }).click();
    await changing(page, async () => {
      await page.getByLabel("time", { exact: true }).fill("0.5");
      await page.getByLabel("time", { exact: true }).press("Tab");
    });
    const shown = await copiedCommand(page);
    assert.ok(shown.includes("--at"), shown.join(" "));
    await isRenderedBy(shown, page, { cwd: folder });
    assert.equal(await page.getByLabel("speed").inputValue(), "1");
  },
);

onPage(
  "the changed scene is saved, and a render of the file shows the same",
  ["cornell-box", "--", "--spp", "1"],
  async (page) => {
    const materials = await unfold(page, "Materials");
    await changing(page, async () => {
      await materials.getByLabel("reflectance red").fill("0.2");
      await materials.getByLabel("reflectance red").press("Tab");
    });
    const download = page.waitForEvent("download");
    await page.getByText("Save", { exact: true }).click();
    await page.getByText("Scene, all of it").click();
    const saved = join(folder, "saved.snell");
    await (await download).saveAs(saved);
    const said = await copiedCommand(page);
    // The camera and the changes are in the file.
    const own = said.filter((word, i) => word !== "-D" && said[i - 1] !== "-D");
    own[2] = saved;
    await isRenderedBy(own, page);
  },
);
