// Light samples as the stages have them: of one light, of many lamps, of a dome, and the sums of
// what they give. Plain data only: nothing here may emit code.
#pragma once
#include <cstddef>
#include <cstdint>

#include "glint.h"
#include "shading/closure/rows.h"

namespace glint {

/// Sums of a batch, a column a channel; null where a part was not asked for. total: Combined.
struct SumColumns {
  double *total[3], *ambient[3], *emission[3], *environment[3], *diffuse[3], *specular[3],
      *shadow[3];
};

/// A point of the unit disc: its direction and the square of its distance from the middle.
struct DiscPlace {
  double azimuth[2], radius2;
};
inline DiscPlace disc_place(double x, double y) {
  const double r2 = x * x + y * y, r = __builtin_sqrt(r2);
  return {{r > 0 ? x / r : 1, r > 0 ? y / r : 0}, r2};
}

enum LightShape : int {
  kDirection,
  kPointSource,
  kSphereSource,
  kDiscSource,
  kPlaneSource,
  kRectangleSource,
  kSky,
  kOpenSky,  // beside points on openings
  kMeshSource,
  kMediumSource,  // points of it are balls
};

/// One over the cosine below which light grazes smooth surfaces, where instances say nothing else.
constexpr double kGrazing = 10;

/// Of the least square of the distance of a mesh light's points, that of what draws directions to
/// them.
constexpr double kNearest = 1e-12;

/// Highlights draw a direction for so many of a dome's.
constexpr size_t kSkyDraws = 8;
constexpr size_t kDomeColumns = 10;  // of rows of GlintRenderSettings.dome_table

/// A dome's maps (glint.h).
struct DomeCells {
  const float *cells = nullptr, *irradiance = nullptr;
  size_t rows = 0, columns = 0, irradiance_rows = 0, irradiance_columns = 0;
  double axes[3][3] = {};
};

/// A rectangle through which a dome is sampled too (glint.h). right, up: half sides; across, along:
/// the same over their squared length. density: of its points by area, for each direction.
struct Opening {
  double center[3], right[3], up[3], across[3], along[3], normal[3], density;
};
struct Openings {
  const Opening* rows = nullptr;
  size_t count = 0;
};
/// A point on one of them.
struct OpeningPoint {
  double at[3], normal[3];
};

/// What the whole dome gives where nothing hides it, less what the directions of a sample do.
struct DomeStage {
  size_t count;
  const double *n[3], *diffuse[3];
  const int64_t* lit;
  const double* drawn;  // rows of 9 numbers, as glint.h has them
  size_t directions;
  const double* x[3];
  const Openings* openings;
  const OpeningPoint* opening_points;
  size_t opening_point_count;
  const DomeCells* dome;
  double* rest[3];
};

/// One sample of one light, as light.h has it for one point.
struct LightStage {
  int shape;
  bool physical, spot, casts_shadow, ellipse;
  const DomeCells* dome;     // kSky, kOpenSky
  const Openings* openings;  // kOpenSky
  bool through;            // kOpenSky: the sample is a point on an opening, `end`, whose normal is
                           // `axis`
  double l[3], factor;     // kDirection, kSky: the unit direction; its intensity. kRectangleSource:
                           // intensity per steradian
  double versine, spread;  // kDirection: 1 - cos of the half angle, and the solid angle
  double end[3];           // kPlaneSource, kRectangleSource: the sample, even over the area
  double back[3];          // kMeshSource, also end, axis, color: the sample, its normal,
                   // what comes from its two sides. spread: one over its density by area; near2:
                   // the least distance^2; size: how far before the surface
                   // segments end. kMediumSource: end, color, spread: by volume; near2: of the
                   // ball's radius
  double right[3], up[3], size, half[2], near2, a,
      b;  // kRectangleSource: unit axes; half the diagonal, half the sides over it; the square
          // of the distance within which it is seen large; the sample in the square
  double center[3], axis[3], color[3];
  double tan_spread;   // kPlaneSource, kRectangleSource: as light.h has it
  double even_spread;  // the same; in CLASSIC 1 / tan_spread
  double radius, scale2, spot_cosine, spot_width, x, y,
      share;  // x, y: of the disc; share: samples of the light
  double area, across[3],
      upward[3];    // kPlaneSource, kRectangleSource: what takes their sides, or axes, to 1
  bool draws;       // whether directions are drawn from lobes whose exponent at the distance d is
                    // least_near d^2 + least
  bool draws_matt;  // kMeshSource: and from what is matt
  bool evenly;      // they weigh by squares, as if there were one for each point of the light
  double least_near, least, radius2,
      azimuth[2];         // or more; where in a lobe: the unit disc's radius^2 and unit direction
  double most_exponent;   // of the scene
  size_t first, count;    // points; first: a multiple of kPad
  const double* disc[2];  // of the unit disc for each point: below the direction of its gather ray,
                          // or where in its lobes what it reflects goes
  const double *points_x[3], *g[3], *n[3], *origin[3], *offset, *d[3], *diffuse[3];
  const double *unbent[3], *bump;    // as stage_bump.h reads them; null where no material has any
  const double *grazing, *lowering;  // as stage_terminator.h reads them; null: kGrazing and 1
  const double* specular;
  size_t stride;
  const LobeLayout* lobes;      // of `specular`
  const LobeSpan* other_lobes;  // its rows of lobes that are no microfacets
  size_t other_count;
  int highlights;  // its rows of microfacets that shine
  const int64_t* lit;
  const double* gloss[3];  // kMediumSource: T k of dielectrics' gloss as if matt; or null
  uint32_t* point;  // what follows: a number for each point that the sample reaches, before shadows
  double *o[3], *to[3], *t_max;  // shadow rays, where the light casts any
  double* start_out[3];          // where they leave the surface; null: at `origin`, or nobody asks
  double* end_out[3];            // ends of their segments; null where nobody asks
  double *diffuse_out[3], *specular_out[3];  // T k I; specular_out null: both in diffuse_out
  double* density_out;  // kMeshSource, of drawn directions: how densely these fall there; the light
                        // is not in diffuse_out yet
  bool gathers_gloss;   // `gather`: what rays do not show of gloss as if it were matt
  bool fibres_alone;    // `gather`: nothing that is matt throws light on
  const double* chooses;  // `gather`: of points on strands a number that chooses a lobe, what is
                          // left of which is in t_max; else -1. null: there are none
  double shown;           // how much of dielectrics' gloss reflected rays show, 0 or 1
  bool shows_nothing;     // no reflected rays show anything, of metals either
  bool has_fibre;         // among the lobes
  bool turns_lobes;       // some SPECULAR lobe may have a normal of its own
  bool stretches_lobes;   // or be stretched
  bool edges_lobes;       // or have the weight of edges
  bool matt_alone, gloss_alone;  // lights no highlights, or no SHEEN and FIBRE_DIFFUSE ones
};

/// A sample of one of many lamps, or (drawn) the directions that lobes draw for it.
struct LampSample {
  LightStage stage;
  bool drawn;
};

/// A point that looks for what is before a lamp's sample. light: the colour of that, as many times
/// as marks lie in it; of all channels together a mark is 1. middle: for one that is seen in a
/// cluster, what n l / d^2 of its middle gives for a colour of 1; else 0.
struct AskedLamp {
  uint32_t sample, point;
  double light[3], middle;
};

/// Lamps that far points see as one, in a tree along their order: those in front, whose middle is
/// at least 4 radii away, and so many that their light is even over the point's lobes. Of each
/// channel: what their places add to light from the middle, to second order (stage_cluster.h).
struct LampCluster {
  uint32_t first, end,
      last;       // of their samples; the last that is a place on a lamp
  uint32_t next;  // the cluster after those within this one; one lamp alone has none within
  int moments;    // 0: there are none; 1: all channels share the first; 3
  double center[3], radius2, color[3];
  double dipole[3][3], quadrupole[3][6], trace[3];
};

/// Points that it works on at once.
constexpr size_t kShareBlock = 64;

/// What many lamps give before shadows, and which of their samples each point asks for shadows:
/// those in which the marks j + offset, j = 0 … asked - 1, lie, where what they give stands in a
/// row that is as long as there are marks.
struct ShareStage {
  size_t count;
  const int64_t* lit;
  const double *x[3], *n[3];
  const LampSample* samples;
  size_t sample_count;
  double offset;
  uint32_t asked;
  double *diffuse[3], *specular[3], *total;  // of each point; total: all channels of both
  double* gloss[3];  // where samples have one: LightStage's, to be found; or null
  /// Those of the samples from `clustered` on; color_sums: a row of three channels before each
  /// sample and after the last, sums of the lamps' colours.
  const LampCluster* clusters;
  size_t cluster_count, clustered;
  const double* color_sums;
  int64_t* near;       // mask of points that clustered samples may reach by themselves
  uint32_t* reaching;  // room for all samples and clusters: those that may reach a block of points,
                       // a cluster as number of samples plus its own
  double* given;       // room for a block of points, three times for each of them
  AskedLamp* chosen;   // room for so many as are asked, for each point
  const uint32_t* groups;      // of lights, of each sample; null where nobody asks
  double* const* group_given;  // three columns for each group, to which what it gives is added
};

/// total[point[k]] += given[k] where the ray is free.
struct LightSum {
  size_t count;
  const uint32_t* point;
  const uint8_t* blocked;
  const double* given[3];
  double* total[3];
};

/// The same with what else is known: diffuse and specular light apart, how much of it gets through,
/// and the parts that are kept.
struct LightParts {
  size_t count;
  const uint32_t* point;
  const uint8_t* blocked;
  const double *shadow[3], *diffuse[3], *specular[3];  // shadow: S, null where rays are free or
                                                       // blocked and no more.  specular: or null
  SumColumns sums;
};

}  // namespace glint
