// Puts the renderer of the page in the place of a server, before anything is asked of it.

import { replaceHost } from "../host";
import { alone, beginWith } from "./host";
import { asked, isAddress, parseLink } from "./link";

const { link } = parseLink(asked());

/** The built-in scene that the renderer begins with, if a link names one. */
export const first = link && !isAddress(link.scene) ? link.scene : null;

beginWith(first, link === null);
replaceHost(alone);

// For scripts, as requests to the server of `snell view` are: `snell.ask("save?format=png")`.
Object.assign(window, { snell: { ask: alone.ask } });
