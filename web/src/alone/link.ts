// Links to a view: the part of the address behind `#` names the scene, the camera and the settings.

import type { Camera } from "../camera";
import type { ViewInfo } from "../protocol.gen";

/** What a link says. What it does not say is as the scene has it. */
export interface Link {
  /** The name of a built-in scene, or the address of a file. */
  scene: string;
  camera?: Camera;
  integrator?: string;
  spp?: number;
  max_depth?: number;
  aov?: string;
  accelerator?: string;
  exposure?: number;
  tonemap?: string;
  /** Other settings of the render, by name. */
  settings: Record<string, string>;
}

/** True for the address of a file, as opposed to the name of a built-in scene. */
export const isAddress = (scene: string): boolean => /[/.:]/.test(scene);

/** What the address of the page asks for, behind `#` or, in links of other pages, behind `?`. */
export const asked = (): string =>
  document.location.hash.length > 1 ? document.location.hash : document.location.search;

const NUMBERS = ["spp", "max_depth", "exposure"] as const;
const NAMES = ["integrator", "aov", "accelerator", "tonemap"] as const;

/** Reads a link; what it says that is not understood is in `problems`. */
export function parseLink(hash: string): { link: Link | null; problems: string[] } {
  const link: Link = { scene: "", settings: {} };
  const problems: string[] = [];
  for (const [name, value] of new URLSearchParams(hash.replace(/^[#?]/, ""))) {
    const number = NUMBERS.find((known) => known === name);
    const text = NAMES.find((known) => known === name);
    if (name === "scene") link.scene = value;
    else if (name === "camera") {
      try {
        link.camera = JSON.parse(value) as Camera;
      } catch {
        problems.push("its camera is cut off");
      }
    } else if (number) {
      if (value !== "" && Number.isFinite(Number(value))) link[number] = Number(value);
      else problems.push(`${name} is no number`);
    } else if (text) link[text] = value;
    else if (name !== "") link.settings[name] = value;
  }
  return { link: link.scene === "" ? null : link, problems };
}

/** The link to what is shown. */
export function linkTo(scene: string, camera: Camera, view: ViewInfo): string {
  const pairs: [string, string][] = [["scene", scene]];
  for (const name of [...NAMES, ...NUMBERS]) {
    const value = view[name];
    if (value !== "") pairs.push([name, String(value)]);
  }
  pairs.push(...Object.entries(view.settings), ["camera", JSON.stringify(camera)]);
  // Slashes and the like are allowed there, and an address is easier to read with them.
  const written = (text: string): string =>
    encodeURIComponent(text).replace(/%(2F|3A|2C)/g, decodeURIComponent);
  return `#${pairs.map(([name, value]) => `${name}=${written(value)}`).join("&")}`;
}
