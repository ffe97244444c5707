/// <reference types="node" />
// The table in README.md names tests that exist.

import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { expect, it } from "vitest";

const here = import.meta.dirname;
const WIDTH = /\$\{width\}/g;
const viewer = join(here, "../../crates/viewer/src");

const sources = (folder: string, ending: string): string =>
  readdirSync(folder, { recursive: true, encoding: "utf8" })
    .filter((name) => name.endsWith(ending))
    .map((name) => readFileSync(join(folder, name), "utf8"))
    .join("\n");

it("what the table names exists", () => {
  const rows = readFileSync(join(here, "README.md"), "utf8").split("\n");
  const named = rows
    .filter((row) => row.startsWith("| "))
    .flatMap((row) => [...row.split("|")[2]!.matchAll(/`([^`]+)`/g)].map((match) => match[1]!));
  expect(named.length).toBeGreaterThan(60);
  const [pages, server] = [
    sources(here, ".mjs") + sources(here, ".test.ts"),
    sources(viewer, ".rs"),
  ];
  // Names of tests for several widths are made from a pattern.
  const text = pages + pages.replace(WIDTH, "1280") + pages.replace(WIDTH, "390");
  const missing = named.filter(
    (name) =>
      !text.includes(`"${name}"`) &&
      !text.includes(`\`${name}\``) &&
      !server.includes(`fn ${name}()`),
  );
  expect(missing).toEqual([]);
});
