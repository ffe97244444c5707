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
pixel: [number, number], } | { "type": "explain", 
/**
 * Returned with the answer.
 */
id: number, 
/**
 * The pixel.
 */
pixel: [number, number], 
/**
 * The sample to show; none for a typical one.
 */
sample?: number | null, 
/**
 * Whether rays are followed through all structures, however long it takes to build them.
 */
all?: boolean, } | { "type": "ack", 
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
choices: Choices, 
/**
 * True if nobody has named a scene: the page offers some.
 */
is_gallery: boolean, } | { "type": "scene", 
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
hit: PickedHit | null, } | { "type": "explained", 
/**
 * The number of the question.
 */
id: number, 
/**
 * The answer; none if there is an error, which was told before.
 */
report: Report | null, } | { "type": "error", 
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
scenes: Array<SceneChoice>, 
/**
 * The parameters of materials and lights, by the name of their family.
 */
forms: { [key in string]: Form }, };

export type Form = { 
/**
 * Its name.
 */
name: string, 
/**
 * What it looks like: `flag`, `number`, `color`, `vector`, `choice`, or `other`.
 */
kind: string, 
/**
 * Between which numbers it usually is, if there are two.
 */
range: [number, number] | null, 
/**
 * What it is measured in; empty for plain numbers.
 */
unit: string, 
/**
 * What it is, in words.
 */
doc: string, 
/**
 * The names of a choice.
 */
options: Array<string>, 
/**
 * The parameters inside.
 */
fields: Array<Form>, 
/**
 * The field inside that says which of `kinds` it is; empty if its name stands around it.
 */
tag: string, 
/**
 * The parameters inside, by kind.
 */
kinds: { [key in string]: Array<Form> }, };

export type SceneChoice = { 
/**
 * Its name.
 */
name: string, 
/**
 * What is to be seen.
 */
description: string, };

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
 * How far its environment is turned about up, in degrees; none if there is none, or one that
 * is the same all around.
 */
environment_rotation: number | null, 
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

export type Report = { 
/**
 * The scene's name.
 */
scene: string, 
/**
 * The pixel, from the upper left corner.
 */
pixel: [number, number], 
/**
 * Width and height of the picture.
 */
size: [number, number], 
/**
 * The integrator.
 */
integrator: string, 
/**
 * The pixel in the picture: red, green, blue, alpha.
 */
value: [number, number, number, number], 
/**
 * Standard error of red, green, blue.
 */
error: [number, number, number], 
/**
 * Samples of the pixel.
 */
spp: number, 
/**
 * The pixel as the samples come in.
 */
convergence: Array<Point>, 
/**
 * Its light, by the way that it took; the brightest first.
 */
classes: Array<PathClass>, 
/**
 * The colours of the samples, by number.
 */
samples: Array<[number, number, number]>, 
/**
 * One sample in all detail.
 */
tree: SampleReport, 
/**
 * The way of that sample's camera ray through acceleration structures.
 */
journeys: Array<JourneyReport>, 
/**
 * Corners of the box around the scene.
 */
bounds: [[number, number, number], [number, number, number]], 
/**
 * Some points that the camera sees.
 */
cloud: Array<[number, number, number]>, };

export type Point = { 
/**
 * How many.
 */
samples: number, 
/**
 * Their mean.
 */
value: [number, number, number], 
/**
 * Its standard error; 0 while unknown.
 */
error: [number, number, number], };

export type PathClass = { 
/**
 * In Heckbert's letters, from the eye to the light: E, then D (diffuse), G (glossy), S
 * (mirror), T (through), V (medium), L.
 */
way: string, 
/**
 * What it adds to the pixel.
 */
value: [number, number, number], 
/**
 * Its share of the pixel's luminance.
 */
share: number, };

export type SampleReport = { 
/**
 * Its number.
 */
number: number, 
/**
 * Its colour.
 */
color: [number, number, number], 
/**
 * The sum of all contributions of its vertices, in the renderer's order: the same.
 */
sum: [number, number, number], 
/**
 * The filter's weight.
 */
weight: number, 
/**
 * Where its rays ended, parents first.
 */
vertices: Array<VertexReport>, };

export type VertexReport = { 
/**
 * The vertex that the ray came from; none for the camera.
 */
parent: number | null, 
/**
 * Bounces before.
 */
depth: number, 
/**
 * `surface`, `medium`, `escaped` or `absorbed`.
 */
what: string, 
/**
 * Names of the nodes down to the surface.
 */
object: string, 
/**
 * The material's name.
 */
material: string, 
/**
 * Triangle or face.
 */
primitive: number | null, 
/**
 * Where the ray begins.
 */
origin: [number, number, number], 
/**
 * Its direction.
 */
direction: [number, number, number], 
/**
 * Where it ended.
 */
position: [number, number, number] | null, 
/**
 * Shading normal.
 */
normal: [number, number, number] | null, 
/**
 * Length of the ray.
 */
distance: number | null, 
/**
 * What the path carried on arrival.
 */
throughput: [number, number, number], 
/**
 * The lobe that sent the ray; none for the camera's.
 */
lobe: string | null, 
/**
 * Density per steradian with which it was sent; none for mirrors and clear glass.
 */
pdf: number | null, 
/**
 * Light of media on the way, times throughput.
 */
glow: [number, number, number], 
/**
 * Light found here, times throughput and weight.
 */
found: [number, number, number], 
/**
 * Weight of what was found, by multiple importance sampling.
 */
found_weight: number, 
/**
 * Light samples.
 */
lights: Array<LightReport>, };

export type LightReport = { 
/**
 * The light.
 */
source: string, 
/**
 * What scatters its light.
 */
lobe: string, 
/**
 * Where the ray to it begins.
 */
origin: [number, number, number], 
/**
 * Its direction.
 */
direction: [number, number, number], 
/**
 * Where it ends; none for lights at infinity.
 */
end: [number, number, number] | null, 
/**
 * What it would bring.
 */
value: [number, number, number], 
/**
 * What it brings.
 */
brought: [number, number, number], 
/**
 * True if something is in the way.
 */
is_blocked: boolean, 
/**
 * Its weight by multiple importance sampling; it is in the values.
 */
weight: number, };

export type JourneyReport = { 
/**
 * The structure.
 */
accelerator: string, 
/**
 * Nodes visited.
 */
nodes: number, 
/**
 * Cells gone through.
 */
cells: number, 
/**
 * Primitives tested.
 */
primitives: number, 
/**
 * Nodes and cells that there are.
 */
built_nodes: number, 
/**
 * How far the hit is; none if there is none.
 */
distance: number | null, 
/**
 * Where it looked, in order.
 */
stops: Array<StopReport>, 
/**
 * Stops that are not told.
 */
left_out: number, };

export type StopReport = { 
/**
 * `box`, `ball`, `plane` or `stretch` (of the ray itself).
 */
kind: string, 
/**
 * Its middle.
 */
center: [number, number, number], 
/**
 * From the middle to its sides.
 */
axes: [[number, number, number], [number, number, number], [number, number, number]], 
/**
 * True if it holds primitives.
 */
is_leaf: boolean, 
/**
 * How many instances it is within.
 */
level: number, 
/**
 * Primitives tested there.
 */
tested: number, 
/**
 * Distance of a hit that was found there.
 */
found: number | null, };
