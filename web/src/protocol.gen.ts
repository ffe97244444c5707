// Generated from crates/viewer/src/protocol.rs by `SNELL_PROTOCOL=accept cargo test -p snell-viewer protocol`.
import type { Camera } from "./camera";

export const VERSION = 1;
export const HEADER_SIZE = 40;

export type ToServer = { "type": "camera", 
/**
 * Counts up; frames name the last one that they show.
 */
seq: number, 
/**
 * All of the camera.
 */
camera: Camera, } | { "type": "size", 
/**
 * Width and height.
 */
size: [number, number], } | { "type": "render", 
/**
 * Name of an integrator.
 */
integrator?: string | null, 
/**
 * Samples per pixel at rest.
 */
spp?: number | null, 
/**
 * Bounces.
 */
max_depth?: number | null, 
/**
 * Layer to show instead of light, empty for light.
 */
aov?: string | null, 
/**
 * Acceleration structure.
 */
accelerator?: string | null, } | { "type": "display", 
/**
 * Stops.
 */
exposure: number, 
/**
 * Name of a tone map.
 */
tonemap: string, } | { "type": "edit", 
/**
 * Path into the scene.
 */
key: string, 
/**
 * New value.
 */
value: unknown, } | { "type": "show", 
/**
 * Its number.
 */
node: number, 
/**
 * Whether it is seen.
 */
visible: boolean, } | { "type": "undo" } | { "type": "redo" } | { "type": "reload" } | { "type": "pick", 
/**
 * Returned with the answer.
 */
id: number, 
/**
 * Position in pixels.
 */
pixel: [number, number], } | { "type": "ack", 
/**
 * Its number.
 */
frame: number, } | { "type": "steer" };

export type ToPage = { "type": "welcome", 
/**
 * [`VERSION`].
 */
version: number, 
/**
 * Number of this page among those that watch.
 */
client: number, 
/**
 * Names to choose from.
 */
choices: Choices, } | { "type": "scene", 
/**
 * What is in it.
 */
scene: SceneInfo, } | { "type": "view", 
/**
 * The state.
 */
view: ViewInfo, } | { "type": "steering", 
/**
 * Number of the page.
 */
client: number, 
/**
 * Number of pages that watch.
 */
watching: number, } | { "type": "picked", 
/**
 * The number of the question.
 */
id: number, 
/**
 * Nothing if the ray leaves the scene.
 */
hit: PickedHit | null, } | { "type": "error", 
/**
 * For people.
 */
message: string, } | { "type": "busy", 
/**
 * For people.
 */
message: string, };

export type Choices = { 
/**
 * Integrators.
 */
integrators: Array<string>, 
/**
 * Layers.
 */
aovs: Array<string>, 
/**
 * Tone maps.
 */
tonemaps: Array<string>, 
/**
 * Acceleration structures.
 */
accelerators: Array<string>, 
/**
 * Built-in scenes.
 */
scenes: Array<string>, };

export type SceneInfo = { 
/**
 * Its name.
 */
name: string, 
/**
 * Counts up with every change of the scene.
 */
generation: number, 
/**
 * The tree, parents before children; a node that several nodes share stands once.
 */
nodes: Array<NodeInfo>, 
/**
 * Nodes that are not listed because there are too many.
 */
nodes_left_out: number, 
/**
 * Materials with their parameters.
 */
materials: Record<string, unknown>[], 
/**
 * Lights with their parameters.
 */
lights: Record<string, unknown>[], 
/**
 * Cameras.
 */
cameras: Camera[], 
/**
 * Corners of the box around all that is finite.
 */
bounds: [[number, number, number], [number, number, number]], 
/**
 * Direction that is up.
 */
up: [number, number, number], 
/**
 * Triangles, each mesh counted as often as it is seen.
 */
triangles: number, 
/**
 * What reading and compiling had to say.
 */
warnings: Array<string>, 
/**
 * Whether there is a change to take back, and one to make again.
 */
history: [boolean, boolean], };

export type NodeInfo = { 
/**
 * Its number.
 */
id: number, 
/**
 * Number of the parent it is listed under; none for the root.
 */
parent: number | null, 
/**
 * Its name.
 */
name: string, 
/**
 * What it holds.
 */
surfaces: Array<string>, 
/**
 * False if it was hidden.
 */
visible: boolean, };

export type ViewInfo = { 
/**
 * The camera.
 */
camera: Camera, 
/**
 * Width and height in pixels.
 */
size: [number, number], 
/**
 * Integrator at rest.
 */
integrator: string, 
/**
 * Layer shown instead of light; empty for light.
 */
aov: string, 
/**
 * Samples per pixel at rest.
 */
spp: number, 
/**
 * Bounces.
 */
max_depth: number, 
/**
 * Acceleration structure.
 */
accelerator: string, 
/**
 * Exposure in stops.
 */
exposure: number, 
/**
 * Tone map.
 */
tonemap: string, 
/**
 * True if display values have the sRGB curve.
 */
srgb: boolean, 
/**
 * The command that makes the picture at rest.
 */
command: string, };

export type PickedHit = { 
/**
 * Where, in the world.
 */
position: [number, number, number], 
/**
 * Shading normal.
 */
normal: [number, number, number], 
/**
 * Distance from the camera.
 */
distance: number, 
/**
 * The node that holds the surface, if it is known.
 */
node: number | null, 
/**
 * Names from the root to it.
 */
path: Array<string>, 
/**
 * Number of the material, if it is one of the scene's.
 */
material: number | null, 
/**
 * Its name.
 */
material_name: string, 
/**
 * Triangle or face.
 */
primitive: number, };
