// Generated from crates/viewer/src/protocol.rs by `SNELL_PROTOCOL=accept cargo test -p snell-viewer protocol`.
import type { Camera } from "./camera";

export const VERSION = 2;
export const HEADER_SIZE = 44;
export const PART_SIZE = 12;

export type ToServer = { "type": "camera", 
/**
 * Number of the message, which increases with each; frames name the last message that they
 * show.
 */
seq: number, 
/**
 * All parameters of the camera.
 */
camera: Camera, 
/**
 * Number of the gesture: moves of one gesture are undone together.
 */
gesture?: number, } | { "type": "home", 
/**
 * Number of the scene's camera; `None` for the one of the first picture.
 */
camera?: number | null, 
/**
 * Number of the gesture.
 */
gesture?: number, } | { "type": "size", 
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
 * Name of an acceleration structure.
 */
accelerator?: string | null, } | { "type": "set", 
/**
 * The name of the setting.
 */
name: string, 
/**
 * A name or number; null for the value when the scene was opened.
 */
value: unknown, } | { "type": "display", 
/**
 * Exposure in stops.
 */
exposure: number, 
/**
 * Name of a tone map.
 */
tonemap: string, } | { "type": "edit", 
/**
 * Path of the parameter in the scene.
 */
key: string, 
/**
 * New value.
 */
value: unknown, } | { "type": "edits", 
/**
 * Pairs of a key and a value, as in [`Self::Edit`].
 */
edits: [string, unknown][], 
/**
 * The number of the gesture that makes the changes: those of one gesture are one step.
 */
gesture?: number | null, } | { "type": "time", 
/**
 * The name of the animation; `None` for those that are usually played.
 */
clip?: string | null, 
/**
 * The time in seconds.
 */
time: number, } | { "type": "show", 
/**
 * Number of the node.
 */
node: number, 
/**
 * True to show the node.
 */
visible: boolean, } | { "type": "undo" } | { "type": "redo" } | { "type": "reload" } | { "type": "pick", 
/**
 * Number that the answer repeats.
 */
id: number, 
/**
 * Position in pixels.
 */
pixel: [number, number], 
/**
 * How far away another surface may be if none is there, in pixels.
 */
reach?: number, } | { "type": "select", 
/**
 * Number that the answer repeats.
 */
id: number, 
/**
 * Numbers of the nodes from the root to the selected one.
 */
path: Array<number>, 
/**
 * Width of the mask in pixels; 0 for none.
 */
width: number, 
/**
 * The number of a surface of the last node, and of one of its primitives, to be told their
 * material.
 */
surface?: [number, number] | null, } | { "type": "explain", 
/**
 * Number that the answer repeats.
 */
id: number, 
/**
 * Column and row of the pixel.
 */
pixel: [number, number], 
/**
 * Number of the sample to show; `None` for a typical one.
 */
sample?: number | null, 
/**
 * True to follow rays through all structures, even if it takes long to build them.
 */
all?: boolean, } | { "type": "ack", 
/**
 * Number of the frame.
 */
frame: number, } | { "type": "steer" };

export type ToPage = { "type": "welcome", 
/**
 * Version of the protocol: [`VERSION`].
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
 * The contents of the scene.
 */
scene: SceneInfo, } | { "type": "view", 
/**
 * The settings and the camera.
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
 * The surface; `None` if the ray leaves the scene.
 */
hit: PickedHit | null, } | { "type": "selected", 
/**
 * The number of the request.
 */
id: number, 
/**
 * The place; `None` if the scene has no such path.
 */
place: Placement | null, 
/**
 * The pixels; `None` if they were not asked for, or the scene is still being prepared.
 */
mask: Mask | null, 
/**
 * Number of the material of the surface that was asked for, if it has one.
 */
material: number | null, } | { "type": "explained", 
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
message: string, } | { "type": "notice", 
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
 * Names of integrators.
 */
integrators: Array<string>, 
/**
 * Names of layers.
 */
aovs: Array<string>, 
/**
 * Names of tone maps.
 */
tonemaps: Array<string>, 
/**
 * Names of acceleration structures.
 */
accelerators: Array<string>, 
/**
 * Built-in scenes.
 */
scenes: Array<SceneChoice>, 
/**
 * The parameters of materials, lights and patterns, by the name of their family.
 */
forms: { [key in string]: Form }, 
/**
 * A thing of each kind with its defaults, by family and kind.
 */
examples: Record<string, Record<string, Record<string, unknown>>>, 
/**
 * Settings of the render that have no control of their own.
 */
settings: Array<SettingForm>, 
/**
 * Maximum size in bytes of a file that is dropped on the page.
 */
max_upload: number, };

export type Form = { 
/**
 * The name of the parameter.
 */
name: string, 
/**
 * The control for the parameter: `flag`, `number`, `color`, `vector`, `choice`, `texture`, or
 * `other`.
 */
kind: string, 
/**
 * The plausible range of a number, if it is bounded on both sides.
 */
range: [number, number] | null, 
/**
 * The least and the largest number that is possible; none where there is no such bound.
 */
limits: [number | null, number | null], 
/**
 * The value that an emptied field stands for: the default, or for a parameter that has to be
 * given that of an example; null if neither is known.
 */
default: unknown, 
/**
 * True if a texture may multiply the value.
 */
is_textured: boolean, 
/**
 * The unit of the parameter; empty for plain numbers.
 */
unit: string, 
/**
 * The documentation of the parameter.
 */
doc: string, 
/**
 * The names of a choice.
 */
options: Array<string>, 
/**
 * The parameters of a group.
 */
fields: Array<Form>, 
/**
 * The field that names the variant, one of `kinds`; empty if the variant's name is the key
 * around its parameters.
 */
tag: string, 
/**
 * The parameters of each variant, by its name.
 */
kinds: { [key in string]: Array<Form> }, 
/**
 * What each variant is, by its name, where that is known.
 */
docs: { [key in string]: string }, };

export type SceneChoice = { 
/**
 * The name of the scene.
 */
name: string, 
/**
 * What the scene shows.
 */
description: string, };

export type SceneInfo = { 
/**
 * The name of the scene.
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
 * Cameras with their parameters.
 */
cameras: Camera[], 
/**
 * Textures with their parameters.
 */
textures: Record<string, unknown>[], 
/**
 * Number of images.
 */
images: number, 
/**
 * A texture of an image, placed as those of the scene are: what a new one begins with.
 */
new_texture: Record<string, unknown>, 
/**
 * Light from all around.
 */
surroundings: Surroundings, 
/**
 * The node that alone is shown, if there is one.
 */
isolated: number | null, 
/**
 * The motion of the scene; none if nothing moves.
 */
motion: MotionInfo | null, 
/**
 * Minimum and maximum corner of the box around everything finite.
 */
bounds: [[number, number, number], [number, number, number]], 
/**
 * Minimum and maximum corner of the box around the subject: everything but the ground, walls
 * and sky around it.
 */
subject: [[number, number, number], [number, number, number]], 
/**
 * Height of the ground under the subject, along the up direction; `None` without one.
 */
ground: number | null, 
/**
 * The up direction.
 */
up: [number, number, number], 
/**
 * Number of triangles; a mesh counts once per instance.
 */
triangles: number, 
/**
 * Number of shapes, such as spheres, and of pieces of curves.
 */
shapes: number, 
/**
 * Warnings from reading and compiling.
 */
warnings: Array<string>, };

export type MotionInfo = { 
/**
 * The animations.
 */
clips: Array<ClipInfo>, 
/**
 * First and last time of those that are usually played, in seconds.
 */
usual: [number, number], 
/**
 * The animation that is shown; none for those that are usually played.
 */
clip: string | null, 
/**
 * The time that is shown, in seconds; none while the scene rests as its file has it.
 */
time: number | null, };

export type ClipInfo = { 
/**
 * The name, or the number of one that has none.
 */
name: string, 
/**
 * First and last time in seconds.
 */
span: [number, number], };

export type Surroundings = { 
/**
 * The sort of environment: `none`, `color`, or `image`.
 */
environment: string, 
/**
 * The radiance of an environment of one colour, or the factor on that of an image.
 */
light: [number, number, number], 
/**
 * Rotation of an image about the up direction, in degrees.
 */
rotation: number, 
/**
 * The sort of background: `environment`, `color`, `transparent`, or `studio`, a colour with
 * the scene's shadow on a floor.
 */
background: string, 
/**
 * The colour of the background, if it has one.
 */
color: [number, number, number] | null, };

export type NodeInfo = { 
/**
 * Number of the node.
 */
id: number, 
/**
 * Number of the parent under which the node is listed; none for the root.
 */
parent: number | null, 
/**
 * The name of the node.
 */
name: string, 
/**
 * Descriptions of the node's surfaces.
 */
surfaces: Array<string>, 
/**
 * False if the node was hidden.
 */
visible: boolean, };

export type SettingForm = { 
/**
 * The name of the setting.
 */
name: string, 
/**
 * The documentation of the setting.
 */
doc: string, 
/**
 * The value that holds while the setting is not set, in words.
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
 * Increases when the camera changes other than by [`ToServer::Camera`]: by an undo, a request
 * for one of the scene's cameras, another size, another scene. The page then takes the camera.
 */
camera_changes: number, 
/**
 * Whether there is a step to undo, and one to redo.
 */
history: [boolean, boolean], 
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
 * Position of the hit in the world.
 */
position: [number, number, number], 
/**
 * Shading normal at the hit.
 */
normal: [number, number, number], 
/**
 * Distance from the camera.
 */
distance: number, 
/**
 * The node that holds the surface; none if it is not known.
 */
node: number | null, 
/**
 * Names of the nodes from the root to the one that holds the surface.
 */
path: Array<string>, 
/**
 * Numbers of these nodes.
 */
nodes: Array<number>, 
/**
 * Number of the material, if it is one of the scene's.
 */
material: number | null, 
/**
 * The name of the material.
 */
material_name: string, 
/**
 * Number of the surface among those of the node.
 */
surface: number, 
/**
 * Number of the triangle or face.
 */
primitive: number, 
/**
 * Minimum and maximum corner of the box around the node, in the world.
 */
bounds: [[number, number, number], [number, number, number]] | null, 
/**
 * Geometric normal at the hit, on the side that is seen.
 */
facing: [number, number, number], 
/**
 * Length of the ray from the hit against the normal to the opposite side of the body; none if
 * there is no opposite side.
 */
thickness: number | null, 
/**
 * Corners of the face in the world, in order; empty for shapes, which have none.
 */
corners: Array<[number, number, number]>, 
/**
 * For each corner, whether the edge to the next corner is a border or sharp.
 */
sharp: Array<boolean>, };

export type Placement = { 
/**
 * The node that moves: the last of the path that stands in one place only.
 */
node: number, 
/**
 * The name of the node.
 */
name: string, 
/**
 * Number of nodes from the root to the node, which counts.
 */
depth: number, 
/**
 * Map from the node's parent to the world, in rows.
 */
world_from_parent: [[number, number, number, number], [number, number, number, number], [number, number, number, number]], 
/**
 * The node's transform, in rows.
 */
parent_from_node: [[number, number, number, number], [number, number, number, number], [number, number, number, number]], 
/**
 * Minimum and maximum corner of the box around the node's surfaces and those below it, in its
 * own coordinates; none if there are none, or they are infinite.
 */
bounds: [[number, number, number], [number, number, number]] | null, };

export type Mask = { 
/**
 * Width and height.
 */
size: [number, number], 
/**
 * Lengths of runs of pixels, row by row: some that do not show it, some that do, and so on.
 */
runs: Array<number>, };

export type Report = { 
/**
 * The scene's name.
 */
scene: string, 
/**
 * Column and row of the pixel, from the upper left corner.
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
 * Standard errors of red, green and blue.
 */
error: [number, number, number], 
/**
 * Number of samples of the pixel.
 */
spp: number, 
/**
 * The mean after increasing numbers of samples.
 */
convergence: Array<Point>, 
/**
 * The light of the pixel by path class, the brightest first.
 */
classes: Array<PathClass>, 
/**
 * The colours of the samples, by number.
 */
samples: Array<[number, number, number]>, 
/**
 * One of the samples, in full detail.
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
 * The mean of these samples.
 */
value: [number, number, number], 
/**
 * Standard error of the mean; 0 while unknown.
 */
error: [number, number, number], };

export type PathClass = { 
/**
 * The path in Heckbert's letters, from the eye to the light: E, then D (diffuse), G (glossy),
 * S (mirror), T (transmitted), V (medium), L.
 */
way: string, 
/**
 * Contribution of the class to the pixel.
 */
value: [number, number, number], 
/**
 * Share of the class in the pixel's luminance, 0 to 1.
 */
share: number, };

export type SampleReport = { 
/**
 * Number of the sample, from 0.
 */
number: number, 
/**
 * Colour of the sample.
 */
color: [number, number, number], 
/**
 * The sum of all contributions of the path vertices, in the renderer's order: equal to the
 * colour.
 */
sum: [number, number, number], 
/**
 * Weight of the sample in the pixel's filter.
 */
weight: number, 
/**
 * The path vertices, parents first.
 */
vertices: Array<VertexReport>, };

export type VertexReport = { 
/**
 * The previous vertex of the path; `None` for the end of the camera ray.
 */
parent: number | null, 
/**
 * Number of bounces before this vertex.
 */
depth: number, 
/**
 * What the ray met: `surface`, `medium`, `escaped` or `absorbed`.
 */
what: string, 
/**
 * Names of the nodes from the root to the surface.
 */
object: string, 
/**
 * The name of the surface's material.
 */
material: string, 
/**
 * Number of the triangle or face.
 */
primitive: number | null, 
/**
 * The origin of the ray.
 */
origin: [number, number, number], 
/**
 * The direction of the ray.
 */
direction: [number, number, number], 
/**
 * The point where the ray ended.
 */
position: [number, number, number] | null, 
/**
 * Shading normal.
 */
normal: [number, number, number] | null, 
/**
 * Distance that the ray travelled.
 */
distance: number | null, 
/**
 * Throughput of the path on arrival.
 */
throughput: [number, number, number], 
/**
 * The lobe that was sampled for the ray; `None` for the camera ray.
 */
lobe: string | null, 
/**
 * Probability density of the ray's direction per steradian; `None` for mirrors and clear
 * glass.
 */
pdf: number | null, 
/**
 * Emission of media along the ray, times throughput.
 */
glow: [number, number, number], 
/**
 * Light that photons bring, times throughput.
 */
by_photons: [number, number, number], 
/**
 * The number of these photons.
 */
photons: number, 
/**
 * Emission found at the vertex, times throughput and weight.
 */
found: [number, number, number], 
/**
 * Weight of the emission found, in multiple importance sampling.
 */
found_weight: number, 
/**
 * Light samples taken at the vertex.
 */
lights: Array<LightReport>, };

export type LightReport = { 
/**
 * The name of the light.
 */
source: string, 
/**
 * The lobe that scatters the light.
 */
lobe: string, 
/**
 * Start of the shadow ray.
 */
origin: [number, number, number], 
/**
 * Direction of the shadow ray.
 */
direction: [number, number, number], 
/**
 * End of the shadow ray; `None` for lights at infinity.
 */
end: [number, number, number] | null, 
/**
 * Contribution of the light sample if it were unoccluded.
 */
value: [number, number, number], 
/**
 * Actual contribution of the light sample.
 */
brought: [number, number, number], 
/**
 * True if the light sample is occluded.
 */
is_blocked: boolean, 
/**
 * Weight of the light sample in multiple importance sampling, which is included in the values.
 */
weight: number, };

export type TraceReport = { 
/**
 * The name of the structure.
 */
accelerator: string, 
/**
 * Number of nodes visited.
 */
nodes: number, 
/**
 * Number of cells visited.
 */
cells: number, 
/**
 * Number of primitives tested.
 */
primitives: number, 
/**
 * Total number of nodes and cells of the structure.
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
 * The centre of the region.
 */
center: [number, number, number], 
/**
 * Vectors from the centre to the sides of the region.
 */
axes: [[number, number, number], [number, number, number], [number, number, number]], 
/**
 * True if the region holds primitives.
 */
is_leaf: boolean, 
/**
 * Nesting depth of instances.
 */
level: number, 
/**
 * Number of primitives tested in the region.
 */
tested: number, 
/**
 * Distance of a hit that was found in the region.
 */
found: number | null, };
