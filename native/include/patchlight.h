/*
 * Patchlight's kernel: rays through a triangle scene, and what radiosity makes of them.
 *
 * SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Conventions, everywhere in this header:
 *   lengths are metres, world space, right handed; normals are unit length
 *   flux densities (irradiance, radiosity) are W/m^2, linear RGB
 *   vec3 arrays are packed, 3 numbers per element, row-major, not aliased
 *   a surface has two sides with a light of their own: side 0 is the front, which sees the corners
 *     counter-clockwise, side 1 the back; patch p's unknowns are 2 p and 2 p + 1
 *   a function that can fail returns pl_status; outputs are the last parameters
 *   the caller owns every array; what a `create` is given is copied; `destroy(NULL)` is legal
 *   nothing here keeps global state or starts a thread, but for Embree's own, which build the tree of a scene: callers
 *     run disjoint ranges of one job in as many threads as they like, and get the same bytes for every number of them
 */
#ifndef PATCHLIGHT_H
#define PATCHLIGHT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum pl_status {
    PL_OK = 0,
    PL_ERR_MEMORY = -1,
    PL_ERR_ARGUMENT = -2, /* an index or number out of range, a count of 0 where one is needed */
    PL_ERR_EMBREE = -3    /* the library cannot be opened, or is not the one that was measured */
} pl_status;

/* One English sentence, never NULL. */
const char *pl_status_text(pl_status status);

/*
 * Embree, opened at run time.
 *
 *   path  full path of the shared library that the embreex wheel ships
 *
 * PL_ERR_EMBREE: no such library, a function is missing, or its version or the layout of its ray
 * structures is not the one declared here (4.4).
 */
typedef struct pl_embree pl_embree;
pl_status pl_embree_open(const char *path, pl_embree **out_embree);
void pl_embree_close(pl_embree *embree);

/*
 * What passes straight through triangles.
 *
 *   transmittance  3 * triangle_count floats, 0 .. 1: the share of light that passes; a triangle with none is opaque
 *   flags          triangle_count sums of pl_clear_flags. A ray is stopped by chance, by the mean of the three shares
 *   maps           triangle_count: which map multiplies the shares, -1 for none
 *   uvs            6 * triangle_count: where the corners lie in it, from 0 to 1 along a side; it repeats, or goes on as
 *                  at its edges. Not touched, and NULL if you like, where there are no maps
 *   map_shapes     3 * map_count: first pixel, height, width. A map is looked up bilinearly, its row 0 at v = 0
 *   pixels         3 * pixel_count floats, 0 .. 1
 */
typedef enum pl_clear_flags {
    PL_RAYS_STOP = 1, /* scattered rays meet what does not pass, and see the triangle; else that is lost, as in glass */
    PL_RAYS_MISS = 2, /* scattered rays pass as if it were not there */
    PL_SHADOWS_MISS = 4, /* shadow rays do */
    PL_MAP_EXTENDS = 8,  /* beyond 0 .. 1 its map is as at the edges */
    PL_FRONT_OPEN = 16,  /* all rays pass that hit its front, as if it were not there */
    PL_BACK_OPEN = 32    /* or its back */
} pl_clear_flags;
typedef struct pl_clear {
    const float *transmittance;
    const uint8_t *flags;
    const int32_t *maps;
    const float *uvs;
    const int32_t *map_shapes;
    size_t map_count;
    const float *pixels;
    size_t pixel_count;
} pl_clear;

/*
 * A BVH over triangles, both sides visible.
 *
 *   embree         must outlive the scene
 *   vertices       3 * vertex_count doubles; re-centred in double before they become float. PL_ERR_ARGUMENT where one
 *                  is not a number or beyond +-PL_LARGEST_COORDINATE [m]
 *   triangles      3 * triangle_count indices
 *   clear          what passes straight through, NULL = all opaque. PL_ERR_ARGUMENT where a map is not there
 *
 * Triangles without an area are kept, so that indices stay, and never hit.
 */
#define PL_LARGEST_COORDINATE 1e8
typedef struct pl_scene pl_scene;
pl_status pl_scene_create(const pl_embree *embree, const double *vertices, size_t vertex_count,
                          const int32_t *triangles, size_t triangle_count, const pl_clear *clear, pl_scene **out_scene);
void pl_scene_destroy(pl_scene *scene);

/*
 * The first opaque triangle along each ray.
 *
 *   origins, directions  3 * count; directions need not be unit
 *   out_triangles        count indices, -1 where nothing is hit
 *   out_hits             3 * count: u, v (weights of corners 1 and 2) and distance in units of the
 *                        direction's length
 */
void pl_closest_hits(const pl_scene *scene, const double *origins, const float *directions, size_t count,
                     int32_t *out_triangles, float *out_hits);

/* 1 where an opaque triangle lies between the two points, ends excluded, else 0. */
void pl_occluded(const pl_scene *scene, const double *from, const double *to, size_t count, uint8_t *out_occluded);

/*
 * How triangles are cut into patches: rows parallel to the longest edge, cells across each row that run towards the
 * opposite corner, the apex; a cell is one piece, or a square number of them where more is to be told apart. A row's
 * cells have equal areas, a triangle's rows equal heights, so point -> piece and piece -> point are closed forms. A
 * patch is one piece, or several that lie together, of many triangles each smaller than what is to be told apart.
 *
 *   apexes         triangle_count: which corner (0..2) is the apex
 *   first_rows     triangle_count + 1: triangle t has rows first_rows[t] .. first_rows[t + 1] - 1, row 0
 *                  along the longest edge
 *   first_cells    row_count + 1: row r has cells first_cells[r] .. first_cells[r + 1] - 1
 *   first_pieces   cell_count + 1: cell c has pieces first_pieces[c] .. first_pieces[c + 1] - 1, a square number,
 *                  n times n, n at most PL_MOST_ALONG: n rows of equal height, in the order of the triangle's,
 *                  of n columns each
 *   owners         one a piece: which patch it is part of, 0 .. patch_count - 1, each of which has one at least; NULL
 *                  where piece i is patch i
 *   areas          one a piece, of any unit, not read without owners
 */
enum { PL_MOST_ALONG = 16 };
typedef struct pl_patch_layout {
    const uint8_t *apexes;
    const int32_t *first_rows, *first_cells, *first_pieces;
    size_t triangle_count, row_count, cell_count;
    const int32_t *owners;
    const float *areas;
    size_t patch_count;
} pl_patch_layout;
typedef struct pl_patches pl_patches;
pl_status pl_patches_create(const pl_patch_layout *layout, pl_patches **out_patches);
void pl_patches_destroy(pl_patches *patches);
size_t pl_patches_count(const pl_patches *patches);
/* Whether the patches have the scene's number of triangles: whoever takes both relies on it. */
bool pl_patches_fit(const pl_patches *patches, const pl_scene *scene);

/*
 * Points first .. first + count - 1 of a 4-D Owen-scrambled Sobol sequence in [0, 1)^4 (Burley 2020).
 *
 *   out_points  4 * count floats
 */
void pl_sobol_points(uint32_t first, size_t count, uint32_t seed, float *out_points);

/*
 * Points spread evenly over patches, randomised quasi-Monte Carlo.
 *
 *   selected          count patches
 *   samples           points on each patch
 *   out_triangles     count * samples
 *   out_barycentrics  3 * count * samples floats
 */
pl_status pl_patch_points(const pl_patches *patches, const int32_t *selected, size_t count, uint32_t samples,
                          uint32_t seed, int32_t *out_triangles, float *out_barycentrics);

/*
 * Form factors from some sides to all sides: the share of the power leaving a side that lands on each.
 * A row sums to 1 less what escapes, and less what glass takes (the mean of its three shares). Visibility is found by
 * rays.
 *
 * Monte Carlo: cosine rays, stratified in position and direction together by a 4-D Owen-scrambled Sobol
 * sequence (Burley 2020). Hemicube (Cohen & Greenberg 1985): delta form factors of a half cube's pixels,
 * normalised to sum to 1 [their eqs. 12-13], from `positions` points spread over the patch, each
 * hemicube turned about the normal by an angle of its own, its rays through random points of its pixels: where all
 * went through the middles, a long edge would fall on the same side of them at every position (aliasing).
 *
 *   sides      count of them: 2 * patch + side
 *   rays       per side, at least 1
 *   resolution pixels along the top face, even, 2 .. 16384: 3 * resolution^2 rays per position
 *   out_rows   count * 2 * patch_count doubles: millions of small shares must sum to 1
 */
pl_status pl_form_factors_monte_carlo(const pl_scene *scene, const pl_patches *patches, const int32_t *sides,
                                      size_t count, uint32_t rays, uint32_t seed, double *out_rows);
pl_status pl_form_factors_hemicube(const pl_scene *scene, const pl_patches *patches, const int32_t *sides, size_t count,
                                   uint32_t resolution, uint32_t positions, uint32_t seed, double *out_rows);

/*
 * The share of cosine rays from each side that meet nothing within its reach: how much room it has.
 *
 *   reaches       2 * patch_count [m]
 *   first, count  the range of sides
 *   rays          of a side; half of them where these all agree
 *   out_openness  2 * patch_count, at the sides' indices
 */
void pl_openness(const pl_scene *scene, const pl_patches *patches, const float *reaches, size_t first, size_t count,
                 uint32_t rays, uint32_t seed, float *out_openness);

/*
 * Shoot flux along rays from some sides to where they land (stochastic Jacobi, Bekaert 1999).
 *
 *   sides          side_count of them: 2 * patch + side
 *   first_rays     side_count + 1: sides[i] owns rays first_rays[i] .. first_rays[i + 1] - 1
 *   first_samples  side_count: how far each side's own sequence has been used before
 *   ray_flux       3 * side_count: what one ray of a side carries, in fixed point: the caller scales so
 *                  that all rays together stay below 2^62 in each channel: coloured cloth passes a third of the
 *                  rays on, with three times what they carry
 *   first, count   the range of rays
 *   io_received    3 * 2 * patch_count: what has landed, added to atomically; integers, so that the sum
 *                  does not depend on the order
 *   io_escaped     3: what left the scene, or met an open side: what meets the other side lands and goes on, as rays
 *                  that look back along it would have it
 */
void pl_shoot(const pl_scene *scene, const pl_patches *patches, const int32_t *sides, size_t side_count,
              const uint64_t *first_rays, const uint32_t *first_samples, const uint64_t *ray_flux, uint64_t first,
              uint64_t count, uint32_t seed, uint64_t *io_received, uint64_t *io_escaped);

/*
 * Where light is wanted.
 *
 *   positions  3 doubles each, on the triangle, or lifted off it to the smooth surface that it stands for: rays that
 *              leave below its plane start there
 *   normals    the shading normal: the cosine is measured from it
 *   triangles  index of the triangle each lies on, 2 * triangle + side
 *
 * Rays leave from the triangle's plane, pushed off it by a few units in the last place, so that they
 * cannot hit the face that they leave.
 */
typedef struct pl_receivers {
    const double *positions;
    const float *normals;
    const int32_t *triangle_sides;
    size_t count;
} pl_receivers;

/*
 * Emitters that direct light is sampled from.
 *
 * A row of `parameters` (PL_LIGHT_FLOATS floats) for each light, by kind:
 *   POINT  position, intensity, radius, is_soft (1 = disc that faces the receiver), direction, cone cosines
 *          outer and inner (-2, -2: no cone), its profile (0: none, else the k-th has the number k), power of the
 *          distance [m] that the light is multiplied by (0 is the square law, 2 none); the cone's metric, xx, yy, zz,
 *          xy, xz, yz (0: a round one): the cosine of d is d . direction / sqrt(d . metric d)
 *   AREA   centre, radiance, axis u (half side), axis v (half side), is_ellipse, spread (full angle)
 *   SUN    direction to the sun, irradiance, angular radius
 *   MESH   centre, bounding radius, flux-like weight (sum of area * radiance) for choosing; first and
 *          count of its emitting triangles: of no more than PL_EXACT_TRIANGLES their light is summed exactly (Lambert's
 *          formula takes 0.2 us)
 * The last number is 1 for a light that casts no shadows, else 0.
 * Emitting triangles: corners (9 floats), radiance of front and back (6); a MESH light's triangles are
 * chosen with the chances whose cumulative sums, from 0 to 1, are `cumulative`.
 * Profiles (PL_PROFILE_SIDE^2 floats): what the intensity is multiplied by, by the direction from the light, over an
 * octahedron laid out flat as pl_solution.sky is, bilinearly.
 * Positions are relative to `centre`, which the scene was re-centred by: pl_scene_centre.
 */
enum { PL_LIGHT_POINT = 0, PL_LIGHT_AREA = 1, PL_LIGHT_SUN = 2, PL_LIGHT_MESH = 3 };
enum { PL_LIGHT_FLOATS = 24, PL_PROFILE_SIDE = 128, PL_EXACT_TRIANGLES = 8 };
typedef struct pl_lights {
    const int32_t *kinds;
    const float *parameters;
    size_t count;
    const float *triangle_corners;
    const float *triangle_radiances;
    const float *cumulative;
    size_t triangle_count;
    const float *profiles;
    size_t profile_count;
} pl_lights;
void pl_scene_centre(const pl_scene *scene, double out_centre[3]);

/*
 * What gather rays see: the solution on the patches, and where it is too coarse to be taken as it is.
 *
 *   radiosity    3 * 2 * patch_count: reflected radiosity, emission left out
 *   direct       3 * 2 * patch_count: the part of it that is the lights' direct light reflected once
 *   reflectance  3 * 2 * patch_count
 *   kinds        2 * patch_count, a pl_side_kind each
 *   reaches      2 * patch_count: a ray that hits a side from nearer than this [m] does not take its mean
 *                but goes on from the point hit, as the patch may lie half under something; INFINITY for a
 *                side in a gap narrower than its patch, or parted by something, where no mean can stand for the light;
 *                below 0 where every ray takes it, also one that hits a back first: of what is translucent
 *   sky          3 * sky_side^2: pi * the radiance of what rays see that leave the scene, by direction: over an
 *                octahedron laid out flat (Engelhardt & Dachsbacher 2008), texel (column, row) at u = column + 0.5,
 *                v = row + 0.5 over the side, (2 u - 1, 2 v - 1) = (x, y) / (|x| + |y| + |z|), where z < 0 folded out:
 *                (1 - |y|, 1 - |x|) with the signs of (x, y). A side of 1: the same all round
 */
typedef enum pl_side_kind {
    PL_SIDE_EVEN = 0,  /* one radiosity stands for it */
    PL_SIDE_MIXED = 1, /* lights reach one part of it only: rays sample the lights anew where they hit it */
    PL_SIDE_LIGHT = 2  /* so bright that receivers sample it as a light: their own rays must not count it */
} pl_side_kind;
typedef struct pl_solution {
    const float *radiosity;
    const float *direct;
    const float *reflectance;
    const uint8_t *kinds;
    const float *reaches;
    const float *sky;
    size_t sky_side;
} pl_solution;

enum { PL_MANY_LIGHTS = 64 };

/*
 * The light on a lightmap's own texels, once it is about known: finer than any patch.
 *
 *   uvs        6 * triangle_count, which is the scene's: corners in texels, as in pl_rasterise_texels; NaN without a
 *              place
 *   light      width * height: reflected radiosity in one number, as what it costs is to wait for the memory: three
 *              float32 without sign and without their last 10 bits, red lowest. The highest bit marks texels on both
 *              sides of something thin: rays that hit these go on, from however far they come. All bits: no light here
 *   reach      rays that hit from nearer [m] do not take a texel's light, which may lie half under something, but go on
 *
 * Backs have no texels: with these given, a receiver's ray that hits one first does not take its mean, but goes on.
 * Where a ray goes on, it samples the lights if there are fewer than PL_MANY_LIGHTS; of more the shadow of any one
 * matters little, and looking at all of them costs more than the ray: it takes what the patch has of them.
 */
typedef struct pl_texel_light {
    const float *uvs;
    const uint64_t *light;
    int32_t width, height;
    size_t triangle_count;
    float reach;
} pl_texel_light;

/* What gather rays travel through and see; `lights` as in pl_direct, for mixed sides and where rays go on. */
typedef struct pl_gather_scene {
    const pl_scene *scene;
    const pl_patches *patches;
    const pl_solution *solution;
    const pl_texel_light *texels; /* NULL: none is known yet */
    const pl_lights *lights;
} pl_gather_scene;

/*
 * Where light comes from, for groups of neighbouring receivers: their rays are drawn more often from there, and
 * count for less (importance sampling; Jensen 1995, "Importance driven path tracing using the photon map").
 *
 *   groups  one per receiver: its group, or -1 for plain cosine rays
 *   shares  PL_GUIDE_CELLS per group, above 0, sum 1: how often rays leave through each cell of the unit square
 *           that cosine rays are drawn from, in rows of the polar coordinate
 */
enum { PL_GUIDE_SIDE = 8, PL_GUIDE_CELLS = PL_GUIDE_SIDE * PL_GUIDE_SIDE };
typedef struct pl_guides {
    const int32_t *groups;
    const float *shares;
    size_t group_count;
} pl_guides;

/*
 * Mean square of the radiosity's luminance that plain cosine rays see through each cell: what guides are made from.
 *
 *   members, first_members  group g's receivers are members[first_members[g] .. first_members[g + 1] - 1]
 *   first, count            the range of groups
 *   rays                    of each member
 *   out_moments             PL_GUIDE_CELLS per group, at the group's index
 */
pl_status pl_learn_guides(const pl_gather_scene *in, const pl_receivers *receivers, const uint32_t *members,
                          const uint32_t *first_members, size_t first, size_t count, uint32_t rays, uint32_t seed,
                          float *out_moments, uint64_t *out_rays);

/*
 * Irradiance by gathering: the mean radiosity that cosine rays see (final gather).
 *
 *   guides         where rays are drawn from
 *   selected       count indices into the receivers; a receiver's rays hang on its index only
 *   replicates     independent randomisations; their spread is the error estimate
 *   first, count   rays of each replicate, after the first ones that it already has. One scrambled Sobol sequence goes
 *                  through all receivers, count points each: receivers that follow each other share its even spread,
 *                  so that their mean is better than any of them (Ahmed & Wonka 2020, sec. 4)
 *   io_light       3 per selected receiver's index: the sum of radiosity over the rays of all replicates, added to
 *   io_luminances  replicates per selected receiver's index: the sum of its luminance over those of each, added to
 *   out_rays       all rays traced, shadow rays and those that went on included
 */
typedef struct pl_gather_rays {
    uint32_t replicates;
    uint32_t first;
    uint32_t count;
    uint32_t seed;
} pl_gather_rays;
pl_status pl_gather(const pl_gather_scene *in, const pl_receivers *receivers, const pl_guides *guides,
                    const uint32_t *selected, size_t count, pl_gather_rays rays, float *io_light, float *io_luminances,
                    uint64_t *out_rays);

/*
 * Direct irradiance from the lights: shadow rays, emitters chosen by what they would give unoccluded.
 *
 *   first, count   the range of receivers
 *   samples        shadow rays for a receiver on which all light is partly hidden
 *   is_first       whether one that seems to see all or nothing of a light stops at three eighths of these: not where
 *                  receivers are known to be noisy, as what a small part of the rays would have found is then lost
 *   out_irradiance 3 per receiver, at the receiver's index
 *   out_variance   1 per receiver: variance of the irradiance's luminance, estimated
 *   out_rays       shadow rays traced
 */
pl_status pl_direct(const pl_scene *scene, const pl_lights *lights, const pl_receivers *receivers, size_t first,
                    size_t count, uint32_t samples, int32_t is_first, uint32_t seed, float *out_irradiance,
                    float *out_variance, uint64_t *out_rays);

/*
 * Which texels of a lightmap are receivers, and of which point: each texel whose square of bilinear influence
 * (less than 1 texel from its centre along both axes) meets a triangle, and the nearest point of these triangles.
 * What is nearer wins, inside at distance 0; among equals, to 1e-6 texels, the lower triangle.
 *
 *   uvs               6 * triangle_count: corners in texels, the centre of column i at i + 0.5; a triangle with a
 *                     corner that is not finite has no place; zero area is allowed
 *   width, height     at least 1; what lies outside is cut off
 *   out_triangles     width * height indices, -1 where no triangle is near
 *   out_distances     width * height: from the centre to the point [texels], 0 inside, infinite where none
 *   out_barycentrics  3 * width * height: the point, 0 where none
 */
pl_status pl_rasterise_texels(const float *uvs, size_t triangle_count, int32_t width, int32_t height,
                              int32_t *out_triangles, float *out_distances, float *out_barycentrics);

/*
 * Places for charts in an atlas, such that no texel has two charts within bilinear reach, and one free block
 * between them: bottom-left first fit of the outlines, large charts first.
 *
 *   uvs              6 * triangle_count: corners in a frame of the chart's own, not negative, from (0, 0)
 *   first_triangles  chart_count + 1: chart c has triangles first_triangles[c] .. first_triangles[c + 1] - 1
 *   upright          so many charts, the last ones, are not turned
 *   density          texels per unit of uvs
 *   width            of the atlas [texels], at most PL_WIDEST_ATLAS
 *   block            charts are placed in steps of so many texels; 1 packs best, more is faster in a large atlas
 *   out_places       3 * chart_count: column and row of the chart's first block, and whether it is turned (u and v
 *                    swapped). A corner stands at block * (column, row) + PL_CHART_START + density * (u, v)
 *   out_height       rows used [texels]
 *
 * PL_ERR_ARGUMENT also where a corner is negative or no number, or a chart wider than the atlas is wide, and, where it
 * may be turned, higher.
 */
#define PL_CHART_START 0.504
#define PL_WIDEST_ATLAS (1 << 28)
pl_status pl_pack_charts(const double *uvs, size_t triangle_count, const int32_t *first_triangles, size_t chart_count,
                         size_t upright, double density, int32_t width, int32_t block, int32_t *out_places,
                         int32_t *out_height);

/*
 * One level of edge-stopping smoothing over a lightmap's receivers.
 *
 *   grid            which receiver each texel is, row-major, -1 for none; spacing of texels [m], about
 *   receivers       positions and shading normals: no smoothing across creases, steps, or charts
 *   values          3 per receiver
 *   variances       1 per receiver, of their luminance
 *   step            texels between the 5 x 5 taps: 1, 2, 4 ... for successive levels, at most PL_WIDEST_STEP
 *   stops_on_value  0: geometry alone decides; else values further apart than their noise explains are not mixed, and
 *                   the noisier of two counts for four times the other's noise at the most
 *   first_row, row_count  the range; one of many steps is the quickest, as rows a step apart share what they look at
 *   out_values, out_variances  at the receivers' indices; the variance of the weighted mean
 */
typedef struct pl_texel_grid {
    const int32_t *receivers;
    int32_t width, height;
    float spacing;
} pl_texel_grid;
#define PL_WIDEST_STEP (1 << 20)
pl_status pl_smooth(const pl_texel_grid *grid, const pl_receivers *receivers, const float *values,
                    const float *variances, int32_t step, int32_t stops_on_value, int32_t first_row, int32_t row_count,
                    float *out_values, float *out_variances);

/*
 * What stands alone, brought back among its neighbours: a receiver's value is scaled so that its luminance is no more
 * than the brightest and no less than the darkest of the eight texels around it that are samples of the same surface,
 * but by no more than its own noise explains: twice its standard deviation. Smoothing that minds values leaves such
 * noise. With fewer than three such texels a value stays as it is, and so does black.
 *
 *   variances   1 per receiver, of its luminance before it was smoothed; else as of pl_smooth, and not in place
 */
pl_status pl_clamp_outliers(const pl_texel_grid *grid, const pl_receivers *receivers, const float *values,
                            const float *variances, int32_t first_row, int32_t row_count, float *out_values);

/*
 * One round of edge-stopping smoothing over the vertices of meshes: each value becomes the mean of itself, with weight
 * 1, and its neighbours.
 *
 *   graph           value i has the neighbours of edges first_edges[i] .. first_edges[i + 1] - 1
 *   values          3 per value of the graph
 *   variances       1 per value, of their luminance
 *   stops_on_value  as of pl_smooth
 *   first, count    the range of values
 *   out_values, out_variances  at the values' indices, not in place; the variance of the weighted mean
 */
typedef struct pl_vertex_graph {
    const int32_t *first_edges, *neighbours;
    const float *nearness; /* 1 per edge: what the neighbour counts by where it is */
} pl_vertex_graph;
pl_status pl_smooth_graph(const pl_vertex_graph *graph, const float *values, const float *variances,
                          int32_t stops_on_value, size_t first, size_t count, float *out_values, float *out_variances);

#endif
