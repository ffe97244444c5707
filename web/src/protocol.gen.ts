// Generated from crates/viewer/src/protocol.rs by `SNELL_PROTOCOL=accept cargo test -p snell-viewer protocol`.
import type { Camera } from "./camera";

export const VERSION = 1;
export const HEADER_SIZE = 40;

export type ToServer = { "type": "camera", 
/**
 * Increases with each message; frames name the last one that they show.
 */
seq: number, 
/**
 * The complete camera.
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
 * Maximum number of bounces.
 */
max_depth?: number | null, 
/**
 * Layer to show instead of light, empty for light.
 */
aov?: string | null, 
/**
 * Acceleration structure.
 */
accelerator?: string | null, } | { "type": "set", 
/**
 * Its name.
 */
name: string, 
/**
 * A name or number; null for what it was when the scene was opened.
 */
value: unknown, } | { "type": "display", 
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
 * True to show it.
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
 * The sample to show; `None` for a typical one.
 */
sample?: number | null, 
/**
 * True to follow rays through all structures, however long it takes to build them.
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
 * Number of this page among the connected ones.
 */
client: number, 
/**
 * Names to choose from.
 */
choices: Choices, 
/**
 * True if no scene was named: the page offers some.
 */
is_gallery: boolean, } | { "type": "scene", 
/**
 * Its contents.
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
 * Number of connected pages.
 */
watching: number, } | { "type": "picked", 
/**
 * The number of the request.
 */
id: number, 
/**
 * `None` if the ray leaves the scene.
 */
hit: PickedHit | null, } | { "type": "explained", 
/**
 * The number of the request.
 */
id: number, 
/**
 * The answer; `None` after an error, which was reported before.
 */
report: Report | null, } | { "type": "error", 
/**
 * Message for the user.
 */
message: string, } | { "type": "busy", 
/**
 * Message for the user.
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
forms: { [key in string]: Form }, 
/**
 * Settings of the render without a control of their own.
 */
settings: Array<SettingForm>, };

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
 * What it shows.
 */
description: string, };

export type SceneInfo = { 
/**
 * Its name.
 */
name: string, 
/**
 * Increases with every change of the scene.
 */
generation: number, 
/**
 * The tree, parents before children; a node that several nodes share is listed once.
 */
nodes: Array<NodeInfo>, 
/**
 * Number of nodes left out because there are too many.
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
 * Rotation of its environment about the up direction, in degrees; `None` without an
 * environment, or for a uniform one.
 */
environment_rotation: number | null, 
/**
 * Minimum and maximum corner of the box around everything finite.
 */
bounds: [[number, number, number], [number, number, number]], 
/**
 * The up direction.
 */
up: [number, number, number], 
/**
 * Number of triangles; a mesh counts once per instance.
 */
triangles: number, 
/**
 * Warnings from reading and compiling.
 */
warnings: Array<string>, 
/**
 * Whether there is a change to undo, and one to redo.
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
 * Its surfaces.
 */
surfaces: Array<string>, 
/**
 * False if it was hidden.
 */
visible: boolean, };

export type SettingForm = { 
/**
 * Its name.
 */
name: string, 
/**
 * What it is, in words.
 */
doc: string, 
/**
 * What holds while it is not set, in words.
 */
default: string, 
/**
 * The names of a choice; empty for a number.
 */
options: Array<string>, };

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
 * Maximum number of bounces.
 */
max_depth: number, 
/**
 * Acceleration structure.
 */
accelerator: string, 
/**
 * The values of [`Choices::settings`] that are set, by name.
 */
settings: { [key in string]: string }, 
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
 * The command that renders the picture at rest.
 */
command: string, };

export type PickedHit = { 
/**
 * Its position in the world.
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
 * The node that holds the surface, if known.
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
 * The mean after increasing numbers of samples.
 */
convergence: Array<Point>, 
/**
 * Its light by path class, the brightest first.
 */
classes: Array<PathClass>, 
/**
 * The colours of the samples, by number.
 */
samples: Array<[number, number, number]>, 
/**
 * One sample in full detail.
 */
tree: SampleReport, 
/**
 * The traversal of that sample's camera ray through acceleration structures.
 */
traces: Array<TraceReport>, 
/**
 * Minimum and maximum corner of the scene's bounding box.
 */
bounds: [[number, number, number], [number, number, number]], 
/**
 * Some points that the camera sees.
 */
cloud: Array<[number, number, number]>, };

export type Point = { 
/**
 * Number of samples.
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
 * The path in Heckbert's letters, from the eye to the light: E, then D (diffuse), G (glossy),
 * S (mirror), T (transmitted), V (medium), L.
 */
way: string, 
/**
 * Its contribution to the pixel.
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
 * The sum of all contributions of its vertices, in the renderer's order: equal to the colour.
 */
sum: [number, number, number], 
/**
 * The filter's weight.
 */
weight: number, 
/**
 * Its path vertices, parents first.
 */
vertices: Array<VertexReport>, };

export type VertexReport = { 
/**
 * The previous vertex of the path; `None` for the camera's.
 */
parent: number | null, 
/**
 * Number of bounces before.
 */
depth: number, 
/**
 * `surface`, `medium`, `escaped` or `absorbed`.
 */
what: string, 
/**
 * Names of the nodes from the root to the surface.
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
 * The ray's direction.
 */
direction: [number, number, number], 
/**
 * Where the ray ended.
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
 * Throughput of the path on arrival.
 */
throughput: [number, number, number], 
/**
 * The lobe that was sampled for the ray; `None` for the camera's.
 */
lobe: string | null, 
/**
 * Probability density of its direction per steradian; `None` for mirrors and clear glass.
 */
pdf: number | null, 
/**
 * Emission of media along the ray, times throughput.
 */
glow: [number, number, number], 
/**
 * Emission found here, times throughput and weight.
 */
found: [number, number, number], 
/**
 * Its weight in multiple importance sampling.
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
 * The lobe that scatters its light.
 */
lobe: string, 
/**
 * Start of the shadow ray.
 */
origin: [number, number, number], 
/**
 * Its direction.
 */
direction: [number, number, number], 
/**
 * End of the shadow ray; `None` for lights at infinity.
 */
end: [number, number, number] | null, 
/**
 * Its contribution if it is unoccluded.
 */
value: [number, number, number], 
/**
 * Its actual contribution.
 */
brought: [number, number, number], 
/**
 * True if it is occluded.
 */
is_blocked: boolean, 
/**
 * Its weight in multiple importance sampling, which is included in the values.
 */
weight: number, };

export type TraceReport = { 
/**
 * The structure.
 */
accelerator: string, 
/**
 * Nodes visited.
 */
nodes: number, 
/**
 * Cells visited.
 */
cells: number, 
/**
 * Primitives tested.
 */
primitives: number, 
/**
 * Total number of nodes and cells.
 */
built_nodes: number, 
/**
 * Distance of the hit; `None` for a miss.
 */
distance: number | null, 
/**
 * The traversal steps, in order.
 */
steps: Array<StepReport>, 
/**
 * Number of steps left out.
 */
left_out: number, };

export type StepReport = { 
/**
 * `box`, `ball`, `plane` or `stretch` (an interval of the ray).
 */
kind: string, 
/**
 * Its centre.
 */
center: [number, number, number], 
/**
 * Vectors from the centre to its sides.
 */
axes: [[number, number, number], [number, number, number], [number, number, number]], 
/**
 * True if it holds primitives.
 */
is_leaf: boolean, 
/**
 * Nesting depth of instances.
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
