// The controls of the camera in a real browser: the mouse, the keys, the menu, and undo.

import assert from "node:assert/strict";
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { fileURLToPath } from "node:url";
import {
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

const scene = (name) => fileURLToPath(new URL(`../../scenes/${name}`, import.meta.url));

/** Keeps the cameras that the page sends in `window.cameras`. */
function record() {
  window.cameras = [];
  const { send } = WebSocket.prototype;
  WebSocket.prototype.send = function (data) {
    const message = JSON.parse(data);
    if (message.type === "camera") window.cameras.push(message.camera);
    return send.call(this, data);
  };
}

/** The last camera that the page has sent, after some action. */
async function camera(page, act = async () => {}) {
  const before = await page.evaluate(() => window.cameras.length);
  await act();
  await page.waitForFunction((count) => window.cameras.length > count, before);
  await page.waitForTimeout(200);
  return page.evaluate(() => window.cameras.at(-1));
}

const within = (words, act, viewport) => onPage(words, act, { viewport, prepare: record });

const distance = (a, b) => Math.hypot(...a.map((x, i) => x - b[i]));

/** What is at a position of the stage, given as shares of its width and height. */
async function pickAt(page, [x, y]) {
  const box = await page.locator(".stage").boundingBox();
  const before = await page.evaluate(() => document.querySelector(".facts")?.textContent ?? "");
  await page.mouse.click(box.x + box.width * x, box.y + box.height * y);
  await page.waitForFunction(
    (old) => (document.querySelector(".facts")?.textContent ?? "") !== old,
    before,
  );
  const row = page.locator(".facts tr", { hasText: "Position" }).locator("td");
  return (await row.textContent()).split(", ").map(Number);
}

const CORNELL = ["cornell-box", "--", "--spp", "1"];

test(
  "a drag down raises the camera, a drag to the right turns the scene with the hand",
  {
    timeout: PATIENCE,
  },
  () =>
    within(CORNELL, async (page) => {
      const first = await camera(page, () => drag(page, 0, 60));
      assert.ok(first.towards[1] < -0.1, "it looks down");
      const second = await camera(page, () => drag(page, 60, 0));
      assert.ok(second.eye[0] !== first.eye[0]);
      const right = [
        first.towards[1] * first.up[2] - first.towards[2] * first.up[1],
        first.towards[2] * first.up[0] - first.towards[0] * first.up[2],
      ];
      const moved = (second.eye[0] - first.eye[0]) * right[0];
      assert.ok(moved < 0, "the camera goes to the left");
    }),
);

test("the wheel comes closer to what is under the pointer", { timeout: PATIENCE }, () =>
  within(CORNELL, async (page) => {
    const at = [0.62, 0.3];
    const before = await pickAt(page, at);
    const start = await camera(page, async () => {
      await page.mouse.wheel(0, 100);
      await page.waitForTimeout(300);
      await page.mouse.wheel(0, -100);
    });
    const end = await camera(page, async () => {
      for (let i = 0; i < 4; i++) {
        await page.mouse.wheel(0, -120);
        await page.waitForTimeout(60);
      }
    });
    assert.ok(distance(end.eye, before) < 0.7 * distance(start.eye, before), "it is closer");
    await isDone(page);
    // Another point first, so that the table of facts changes.
    await pickAt(page, [0.45, 0.7]);
    const after = await pickAt(page, at);
    assert.ok(distance(before, after) < 0.02 * distance(end.eye, before), `${before} ${after}`);
  }),
);

test("a drag with the right button moves what is under the hand", { timeout: PATIENCE }, () =>
  within(CORNELL, async (page) => {
    const box = await page.locator(".stage").boundingBox();
    const place = ([x, y]) => [box.x + box.width * x, box.y + box.height * y];
    for (const [from, to] of [
      [
        [0.5, 0.35],
        [0.58, 0.5],
      ],
      [
        [0.55, 0.8],
        [0.47, 0.7],
      ],
    ]) {
      const before = await pickAt(page, from);
      await page.mouse.move(...place(from));
      await page.mouse.down({ button: "right" });
      for (let i = 1; i <= 6; i++) {
        const at = from.map((x, axis) => x + ((to[axis] - x) * i) / 6);
        await page.mouse.move(...place(at));
        await page.waitForTimeout(30);
      }
      await page.mouse.up({ button: "right" });
      await isDone(page);
      const after = await pickAt(page, to);
      assert.ok(distance(before, after) < 5, `${before} is at ${after}, in a box of 555`);
    }
  }),
);

test("smoke is not seen from under the ground, whatever is dragged", { timeout: PATIENCE }, () =>
  within(["smoke", "--", "--spp", "1"], async (page) => {
    for (const dy of [-40, -300, -300]) {
      const { eye } = await camera(page, () => drag(page, 0, dy));
      assert.ok(eye[1] > 0, `${eye}`);
    }
  }),
);

test("F sees the subject or what was clicked on, Home sees all", { timeout: PATIENCE }, () =>
  within(["teapot", "--", "--spp", "1"], async (page) => {
    const subject = await camera(page, () => page.keyboard.press("f"));
    const all = await camera(page, () => page.keyboard.press("Home"));
    assert.ok(all.focus_distance > 2 * subject.focus_distance, "the ground is large");
    const again = await camera(page, () => page.keyboard.press("f"));
    assert.ok(Math.abs(again.focus_distance / subject.focus_distance - 1) < 0.3);
    await page.keyboard.press("Shift+F");
    await page.waitForTimeout(200);
    const wide = await page.evaluate(() => window.cameras.at(-1));
    assert.ok(Math.abs(wide.focus_distance - all.focus_distance) < 1e-6 * all.focus_distance);
  }),
);

test("what was clicked on is framed", { timeout: PATIENCE }, () =>
  within(CORNELL, async (page) => {
    const subject = await camera(page, () => page.keyboard.press("f"));
    await isDone(page);
    await pickAt(page, [0.6, 0.75]);
    const selected = await camera(page, () => page.keyboard.press("f"));
    assert.ok(selected.focus_distance < 0.9 * subject.focus_distance);
  }),
);

test(
  "moves of the camera are undone gesture by gesture, and the camera is reset",
  {
    timeout: PATIENCE * 2,
  },
  () =>
    within(CORNELL, async (page) => {
      const pictures = [await fingerprint(page)];
      for (const [dx, dy] of [
        [80, 0],
        [0, 50],
      ]) {
        await drag(page, dx, dy);
        await isDone(page);
        await page.waitForTimeout(300);
        await isDone(page);
        pictures.push(await fingerprint(page));
      }
      assert.equal(new Set(pictures).size, 3);
      await page.keyboard.press("Control+z");
      assert.equal(await settled(page, pictures[1]), pictures[1], "one gesture back");
      await page.keyboard.press("Control+z");
      assert.equal(await settled(page, pictures[0]), pictures[0], "two gestures back");
      await page.keyboard.press("Control+Shift+Z");
      assert.equal(await settled(page, pictures[1]), pictures[1], "and forth");
      await page.keyboard.press("Home");
      await page.keyboard.press("0");
      assert.equal(await settled(page, pictures[0]), pictures[0], "the first picture");
      await page.keyboard.press("Control+z");
      await page.keyboard.press("Control+z");
      assert.equal(await settled(page, pictures[1]), pictures[1], "a reset is undone too");
      await page.getByText("View", { exact: true }).click();
      await page.getByRole("button", { name: "Reset camera" }).click();
      assert.equal(await settled(page, pictures[0]), pictures[0]);
    }),
);

test(
  "orthographic keeps the size of the subject, and its picture is that of its command",
  {
    timeout: PATIENCE,
  },
  () =>
    within(CORNELL, async (page) => {
      const before = await camera(page, () => page.keyboard.press("f"));
      const parallel = await camera(page, () => page.keyboard.press("o"));
      assert.equal(parallel.projection.projection, "orthographic");
      const half = before.projection.tan_half_fov[1] * before.focus_distance;
      assert.ok(Math.abs(parallel.projection.half_size[1] / half - 1) < 1e-6);
      await isDone(page);
      await isRenderedBy(await copiedCommand(page), page);
      const back = await camera(page, () => page.keyboard.press("o"));
      assert.ok(distance(back.eye, before.eye) < 1e-6 * before.focus_distance);
    }),
);

test("the six views look along the axes, from all sides", { timeout: PATIENCE }, () =>
  within(CORNELL, async (page) => {
    const views = [
      ["1", [0, 0, -1]],
      ["2", [0, 0, 1]],
      ["3", [-1, 0, 0]],
      ["4", [1, 0, 0]],
      ["5", [0, -1, 0]],
      ["6", [0, 1, 0]],
    ];
    for (const [key, direction] of views) {
      const { towards } = await camera(page, () => page.keyboard.press(key));
      assert.ok(distance(towards, direction) < 1e-2, `${key}: ${towards}`);
    }
  }),
);

test("all cameras of the file are in the menu", { timeout: PATIENCE }, async () => {
  const file = JSON.parse(readFileSync(scene("pyramid.gltf"), "utf8"));
  const count = file.cameras?.length ?? 0;
  file.cameras = [
    ...(file.cameras ?? []),
    { name: "from above", type: "perspective", perspective: { yfov: 0.5, znear: 0.1 } },
    { name: "plan", type: "orthographic", orthographic: { xmag: 3, ymag: 3, znear: 0, zfar: 9 } },
  ];
  const down = [-Math.SQRT1_2, 0, 0, Math.SQRT1_2];
  for (let i = 0; i < 2; i++) {
    file.nodes.push({ camera: count + i, rotation: down, translation: [0, 9, 0] });
    file.scenes[file.scene ?? 0].nodes.push(file.nodes.length - 1);
  }
  const path = join(folder, "cameras.gltf");
  writeFileSync(path, JSON.stringify(file));
  await within([path, "--", "--spp", "1"], async (page) => {
    const first = await fingerprint(page);
    const seen = [first];
    for (const name of ["from above", "plan"]) {
      await page.getByText("View", { exact: true }).click();
      await page.getByRole("button", { name }).click();
      await page.waitForTimeout(300);
      await isDone(page);
      seen.push(await fingerprint(page));
    }
    assert.equal(new Set(seen).size, 3);
    await isRenderedBy(await copiedCommand(page), page);
    await page.keyboard.press("0");
    assert.equal(await settled(page, first), first);
  });
});

test("nothing that the file shows is cut off in a portrait or a wide window", {
  timeout: PATIENCE * 2,
}, async () => {
  // The angles that the command changes; `null` if those of the file are right.
  const tangents = (command) => {
    const word = command.find((w) => w.startsWith("camera.0.projection="));
    return word ? JSON.parse(word.replace(/^[^=]*=/, "")).tan_half_fov : null;
  };
  // Smoke is 480 x 640 with half an angle of 0.32 across.
  await within(["smoke", "--", "--spp", "1"], async (page) => {
    const [x, y] = tangents(await copiedCommand(page));
    assert.equal(x, null);
    assert.ok(Math.abs(y - (Math.tan(0.32) * 640) / 480) < 1e-6, `${y}`);
  });
  // Cornell's box is square.
  await within(
    CORNELL,
    async (page) => {
      assert.ok((tangents(await copiedCommand(page)) ?? [1, null])[0], "across");
      // Turned by a quarter, and dragged: the angle follows still.
      await drag(page, 30, 0);
      await page.setViewportSize({ width: 900, height: 420 });
      await page.waitForTimeout(500);
      await isDone(page);
      const command = await copiedCommand(page);
      assert.ok((tangents(command) ?? [null, 1])[1], "up and down");
      await isRenderedBy(command, page);
    },
    { width: 390, height: 844 },
  );
});

test(
  "keys fly at a stride that fits the subject, also after a slider was touched",
  {
    timeout: PATIENCE,
  },
  () =>
    within(CORNELL, async (page) => {
      const slider = page.getByLabel("Exposure (stops)").first();
      await slider.click();
      await page.keyboard.press("Tab");
      await page.keyboard.press("Shift+Tab");
      const start = await camera(page, () => page.keyboard.press("f"));
      const end = await camera(page, async () => {
        await page.keyboard.down("w");
        await page.waitForTimeout(500);
        await page.keyboard.up("w");
      });
      const share = distance(end.eye, start.eye) / start.focus_distance;
      assert.ok(share > 0.02 && share < 0.6, `half a second moves by ${share}`);
      // A list that was chosen from with the mouse gives the keys back, too.
      // The press alone, for a list that is open on the screen would take the keys.
      const list = page.getByLabel("Tone map");
      await list.focus();
      await list.dispatchEvent("pointerdown", { bubbles: true });
      await list.selectOption("aces");
      await camera(page, () => page.keyboard.press("1"));
    }),
);
