// What newcomers stumbled over on the page, in a real browser against the real server.

import assert from "node:assert/strict";
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import {
  choose,
  copiedCommand,
  drag,
  drop,
  folder,
  isDone,
  isRenderedBy,
  middle,
  onPage,
  open,
  PATIENCE,
  serve,
  unfold,
} from "./browser.mjs";

const WIDE = { width: 1200, height: 760 };
const started = (words, work, viewport = WIDE) => onPage(words, work, { viewport });
const timeout = PATIENCE * 2;

/** A cube with a side of 2, and two bare triangles. */
const CUBE = join(folder, "cube.obj");
const at = (i) => [i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1];
writeFileSync(
  CUBE,
  `${[...Array(8).keys()].map((i) => `v ${at(i).join(" ")}`).join("\n")}\n` +
    "f 1 5 7 3\nf 2 4 8 6\nf 1 2 6 5\nf 3 7 8 4\nf 1 3 4 2\nf 5 6 8 7\n",
);

const says = (page, part) =>
  page.waitForFunction(
    (text) => document.querySelector(".notices").textContent.includes(text),
    part,
  );

/** The mean of the picture in display values, from 0 to 255. */
const brightness = (page) =>
  page.evaluate(() => {
    const canvas = document.querySelector("canvas.picture");
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    return data.reduce((sum, v, i) => sum + (i % 4 < 3 ? v : 0), 0) / ((data.length / 4) * 3);
  });

/** The mean of the picture while a slow drag goes on. */
async function movingBrightness(page) {
  const [x, y] = await middle(page);
  await page.mouse.move(x, y);
  await page.mouse.down();
  for (let i = 1; i <= 10; i++) {
    await page.mouse.move(x + i, y);
    await page.waitForTimeout(60);
  }
  await page.waitForSelector("canvas[data-kind=jpeg]");
  const found = await brightness(page);
  await page.mouse.up();
  await page.waitForTimeout(300);
  await isDone(page);
  return found;
}

test("a light that was far too bright leaves nothing behind when it is undone", { timeout }, () =>
  started([CUBE, "--", "--spp", "4"], async (page) => {
    const before = await movingBrightness(page);
    const lights = await unfold(page, "Lights");
    await lights.getByLabel("Add a light").selectOption("point");
    const strength = lights.getByLabel("intensity strength");
    await strength.fill("1000000");
    await strength.press("Tab");
    await page.waitForTimeout(500);
    await isDone(page);
    await page.getByRole("button", { name: "Undo", exact: true }).click();
    await page.getByRole("button", { name: "Undo", exact: true }).click();
    await page.getByText("Lights (0)").waitFor();
    await page.waitForTimeout(500);
    await isDone(page);
    const after = await movingBrightness(page);
    assert.ok(Math.abs(after - before) < 8, `${before} and then ${after}`);
  }),
);

test(
  "an empty file is refused, and changes come back after another scene was opened",
  { timeout },
  () =>
    started(["cornell-box", "--", "--spp", "1"], async (page) => {
      const materials = await unfold(page, "Materials");
      await materials.getByLabel("reflectance red").fill("0.25");
      await materials.getByLabel("reflectance red").press("Tab");
      await drop(page, [["empty.obj", ""]]);
      await says(page, "there is nothing to see in it");
      assert.match(await page.title(), /^cornell-box/);
      await drop(page, [["triangle.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"]]);
      await page.waitForFunction(() => document.title.startsWith("triangle"));
      await says(page, "cornell-box had changes; undo brings them back");
      await page.getByRole("button", { name: "Undo", exact: true }).click();
      await page.waitForFunction(() => document.title.startsWith("cornell-box"));
      const again = await unfold(page, "Materials");
      await page.waitForFunction(
        () => document.querySelector('[aria-label="reflectance red"]')?.value === "0.25",
      );
      assert.equal(await again.getByLabel("reflectance red").inputValue(), "0.25");
      await isDone(page);
      await isRenderedBy(await copiedCommand(page), page);
      await page.getByRole("button", { name: "Redo", exact: true }).click();
      await page.waitForFunction(() => document.title.startsWith("triangle"));
    }),
);

test(
  "what was picked follows changes and undo, and new materials have names of their own",
  { timeout },
  () =>
    started([CUBE, "--", "--spp", "1"], async (page) => {
      const [x, y] = await middle(page);
      await page.mouse.click(x, y);
      const facts = page.locator(".facts");
      await facts.waitFor();
      assert.match(await facts.innerText(), /Material\s+none/);
      const button = page.getByRole("button", { name: "Give it a material" });
      const shows = (name) =>
        page.waitForFunction(
          (text) => document.querySelector(".facts").innerText.match(/Material\s+(.*)/)[1] === text,
          name,
        );
      await button.click();
      await shows("material");
      assert.equal(await button.count(), 0);
      await page.getByRole("button", { name: "Undo", exact: true }).click();
      await shows("none");
      assert.equal(await button.count(), 1);
    }),
);

test(
  "a light stands in the picture, is chosen by its mark and removed by its button or Delete",
  { timeout },
  () =>
    started([CUBE, "--", "--spp", "1"], async (page) => {
      // From near, where what lies above the subject is outside of the picture.
      await page.mouse.move(...(await middle(page)));
      for (let i = 0; i < 5; i++) await page.mouse.wheel(0, -100);
      await page.waitForTimeout(500);
      await isDone(page);
      const lights = await unfold(page, "Lights");
      for (const kind of ["point", "spot"])
        await lights
          .getByLabel("Add a light")
          .selectOption(kind)
          .then(() => page.waitForTimeout(600));
      await page.getByText("Lights (2)").waitFor();
      const marks = page.locator(".overlay .lamp");
      assert.equal(await marks.count(), 2, "both are seen");
      // They stand at one place: the first one is moved away.
      await lights.getByLabel("Which").selectOption("0");
      const place = lights.getByLabel("position x");
      const far = Number(await place.inputValue()) - 0.5;
      await place.fill(String(far));
      await place.press("Tab");
      await page.waitForTimeout(600);
      await isDone(page);
      await marks.nth(1).locator(".bulb").click();
      await page.waitForSelector('.lamp.chosen[data-light="1"]');
      assert.equal(await lights.getByLabel("Kind", { exact: true }).inputValue(), "spot");
      assert.equal(await page.locator(".facts").count(), 0, "nothing else was picked");
      await page.locator(".stage").focus();
      await page.keyboard.press("Delete");
      await page.getByText("Lights (1)").waitFor();
      assert.equal(await lights.getByLabel("Kind", { exact: true }).inputValue(), "point");
      await page.waitForTimeout(400);
      await isDone(page);
      const command = await copiedCommand(page);
      assert.ok(command.includes("light.1=null"), command.join(" "));
      assert.equal(command.filter((word) => word === "--spp").length, 1, command.join(" "));
      await isRenderedBy(command, page);
      await lights.getByRole("button", { name: "Remove", exact: true }).click();
      await page.getByText("Lights (0)").waitFor();
      await page.getByRole("button", { name: "Undo", exact: true }).click();
      await page.getByRole("button", { name: "Undo", exact: true }).click();
      await page.getByText("Lights (2)").waitFor();
    }),
);

test("the gallery's captions can be read in small windows, and it scrolls", {
  timeout,
}, async () => {
  const server = await serve();
  try {
    for (const viewport of [
      { width: 960, height: 600 },
      { width: 390, height: 780 },
    ]) {
      const { page } = await open(server.url, () => {}, viewport);
      await page.waitForSelector(".card");
      const cut = await page.evaluate(() =>
        [...document.querySelectorAll(".card")]
          .filter((card) => {
            const last = card.querySelector("small").getBoundingClientRect();
            return last.bottom > card.getBoundingClientRect().bottom + 0.5 || last.height < 10;
          })
          .map((card) => card.textContent),
      );
      assert.deepEqual(cut, []);
      const last = page.locator(".card small").last();
      await last.scrollIntoViewIfNeeded();
      const box = await last.boundingBox();
      assert.ok(box.y + box.height <= viewport.height, `${viewport.width}`);
      await page.close();
    }
  } finally {
    await server.stop();
  }
});

test("silhouettes are not in the range of the depth", { timeout }, () =>
  started([CUBE, "--", "--spp", "8"], async (page) => {
    await page.locator(".field", { hasText: /^Show/ }).locator("select").selectOption("depth");
    const low = page.getByLabel("lower end of the colours");
    await low.waitFor();
    await page.waitForTimeout(500);
    await isDone(page);
    const [near, far] = [
      Number(await low.inputValue()),
      Number(await page.getByLabel("upper end of the colours").inputValue()),
    ];
    // All of the cube lies within twice its half diagonal.
    assert.ok(far - near < 2 * Math.sqrt(3) + 1e-3, `${near} to ${far}`);
    await page.keyboard.press("h");
    await page.getByText("Histogram of depth, as shown").waitFor();
    // A number that is none changes nothing, an emptied field goes back to the whole range.
    await low.fill(String(near + 0.5));
    await low.press("Tab");
    await low.fill("");
    await low.press("Tab");
    assert.ok(Math.abs(Number(await low.inputValue()) - near) < 0.05);
  }),
);

test("fields keep their number when what is typed is none", { timeout }, () =>
  started([CUBE, "--", "--spp", "1"], async (page) => {
    const lights = await unfold(page, "Lights");
    await lights.getByLabel("Add a light").selectOption("point");
    const strength = lights.getByLabel("intensity strength");
    await strength.waitFor();
    const type = async (field, text) => {
      await field.click();
      await page.keyboard.press("Control+a");
      await page.keyboard.press("Backspace");
      await page.keyboard.type(text);
      await page.keyboard.press("Tab");
      await page.waitForTimeout(300);
    };
    const before = await strength.inputValue();
    for (const text of ["1e400", "--", "e"]) {
      await type(strength, text);
      assert.equal(await strength.inputValue(), before, text);
    }
    for (const text of ["0", "3", "0"]) {
      await type(strength, text);
      // The next field has the focus now, and follows nevertheless.
      await page.waitForFunction(
        (wanted) => document.querySelector('[aria-label="intensity red"]').value === wanted,
        text,
      );
      assert.equal(await strength.inputValue(), text);
    }
    const camera = await unfold(page, "Camera");
    const lens = camera.getByLabel("Lens radius").last();
    await type(lens, "0.01");
    await type(lens, "1e400");
    assert.equal(await lens.inputValue(), "0.01");
    await type(lens, "");
    assert.equal(await lens.inputValue(), "0");
    const picture = await unfold(page, "Picture");
    const exposure = picture.getByLabel("Exposure (stops)").last();
    await type(exposure, "2");
    await type(exposure, "1e400");
    assert.equal(await exposure.inputValue(), "2");
    await type(exposure, "");
    assert.equal(await exposure.inputValue(), "0");
  }),
);

test(
  "several pictures, several scenes and odd bytes are said to be what they are",
  { timeout },
  () =>
    started([CUBE, "--", "--spp", "1"], async (page) => {
      await drop(page, [
        ["a.png", "x"],
        ["b.hdr", "y"],
      ]);
      await says(page, "2 pictures at once are too many");
      await drop(page, [["odd.glb", "\u0007random"]]);
      await says(page, "this is not a binary glTF (.glb) file");
      const mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
      await drop(page, [
        ["one.obj", mesh],
        ["two.obj", mesh],
      ]);
      await says(page, "one.obj was opened; drop one of these alone to see it: two.obj");
    }),
);

test("Escape ends the section, and an explanation that is waited for", { timeout }, () =>
  started([CUBE, "--", "--spp", "1"], async (page) => {
    await choose(page, "Tools", "Section");
    // It cuts at once, through the middle.
    const place = page.getByLabel("place of the section, in units of the scene");
    await place.waitFor();
    assert.equal(Number(await place.inputValue()), 0);
    await page.keyboard.press("Escape");
    await place.waitFor({ state: "detached" });
    await page.evaluate(() => {
      const send = WebSocket.prototype.send;
      // The answer never comes.
      WebSocket.prototype.send = function (data) {
        if (!String(data).includes('"explain"')) send.call(this, data);
      };
    });
    await page.mouse.move(...(await middle(page)));
    await page.keyboard.press("x");
    await page.getByText("following the light").waitFor();
    await page.keyboard.press("Escape");
    await page.getByText("following the light").waitFor({ state: "detached" });
  }),
);

test("a picture that is kept while it moves is the next one at rest", { timeout }, () =>
  started(["cornell-box", "--", "--spp", "2"], async (page) => {
    await drag(page, 40, 0);
    await page.keyboard.press("c");
    await page.getByText(/^kept, \d+ sample/).waitFor();
    assert.equal(await page.evaluate(() => document.querySelector("canvas").dataset.kind), "half");
  }),
);

test("of two pages one watches, and is told once why a drag does nothing", { timeout }, () =>
  started([CUBE, "--", "--spp", "1"], async (first, server) => {
    const { page: second } = await open(server.url);
    await first.getByText("1 watches").waitFor();
    await drag(second, 60, 0);
    await says(second, "Another page steers");
    assert.equal(await second.locator(".notices p").count(), 1);
    await second.close();
  }),
);

test("the picture can be clicked on beside the buttons of a palette", { timeout }, () =>
  started(["cornell-box", "--", "--spp", "1"], async (page) => {
    await page.keyboard.press("m");
    const palette = await page.locator(".palette").boundingBox();
    await page.mouse.click(palette.x + 2, palette.y + 2);
    const is = await page.evaluate(
      ([x, y]) => document.elementFromPoint(x, y).closest(".palette") === null,
      [palette.x + 2, palette.y + 2],
    );
    assert.ok(is);
  }),
);
