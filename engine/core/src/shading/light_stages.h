// Light samples as the stages have them: of one light, of many lamps, of a dome, and the sums of
// what they give. Plain data only: nothing here may emit code.
#pragma once
#include <cstddef>
#include <cstdint>

#include "glint.h"
#include "shading/closure/rows.h"
#include "shading/light/samples.h"
#include "shading/path_state.h"

namespace glint {

/// One over the cosine below which light grazes smooth surfaces, where instances say nothing else.
constexpr double kGrazing = 10;

/// The lobes of points but for what is Lambert's: columns, and what all of them have. shown: how
/// much of dielectrics' gloss reflected rays show, 0 or 1; shows_nothing: of metals' neither.
struct LobeColumns {
  const double* columns;
  size_t stride;
  const LobeLayout* layout;
  const LobeSpan* others;  // rows of lobes that are no microfacets
  size_t other_count;
  int highlights;                           // rows of microfacets that shine
  bool has_fibre, turns, stretches, edges;  // turns: some SPECULAR lobe may have a normal of its
                                            // own. edges: or the weight of edges
  bool shows_nothing;
  double shown;
};

/// Points to be lit, of which stages take [first, count); first: a multiple of kPad.
struct LitPoints : BatchColumns {
  size_t first, count;
  const double* gloss[3];  // T k of dielectrics' gloss as if it were matt; or null
  LobeColumns lobes;
};

/// What the whole dome gives where nothing hides it, less what the directions of a sample do.
struct DomeStage {
  const LitPoints* points;
  const int64_t* lit;
  const double* drawn;  // rows of 9 numbers, as glint.h has them
  size_t directions;
  const Openings* openings;
  const OpeningPoint* opening_points;
  size_t opening_point_count;
  const DomeCells* dome;
  double* rest[3];
};

/// What stages write: a row for each point that a sample reaches, before shadows.
struct ShadowRays {
  uint32_t* point;
  double *o[3], *to[3], *t_max;
  const double* origin[3];  // the points'
  double* start[3];  // where they leave the surface; null: at the points' origin, or nobody asks
  double* end[3];    // of their segments; null where nobody asks
  double *diffuse[3], *specular[3];  // T k I; specular null: both in diffuse
  double* pdf;  // of directions drawn to mesh lights, whose light is not in diffuse yet
};

/// Rays that go on from points along directions of their lobes. disc: a point of the unit disc
/// each, below the direction, or where in its lobes it is.
struct OnwardStage {
  const LitPoints* points;
  const int64_t* lit;
  const double* disc[2];
  ShadowRays rays;  // o, to, and in diffuse what the radiance from there is times
  // Of bounced light:
  bool gathers_gloss;     // what rays do not show of gloss as if it were matt
  bool fibres_alone;      // nothing that is matt throws light on
  const double* chooses;  // of points on strands a number that chooses a lobe, what is left of
                          // which is in t_max; else -1. null: there are none
};

/// A point that looks for what is before a lamp's sample. light: the colour of that, times how many
/// of the point's rays fall to it. middle: for one that is seen in a cluster, what n l / d^2 of its
/// middle gives for a colour of 1; else 0.
struct ShadowRequest {
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

/// What many lamps give before shadows, and which of their samples each point asks for shadows, by
/// systematic resampling: those in which j + offset, j = 0 … rays - 1, lie, where contributions
/// stand in a row of length `rays`.
struct ShareStage {
  const LitPoints* points;
  const int64_t* lit;
  const LampSample* samples;
  size_t sample_count;
  double offset;
  uint32_t rays;
  double *diffuse[3], *specular[3], *total;  // of each point; total: all channels of both
  double* gloss[3];                          // the points', to be found; or null
  /// Those of the samples from `clustered` on; color_sums: a row of three channels before each
  /// sample and after the last, sums of the lamps' colours.
  const LampCluster* clusters;
  size_t cluster_count, clustered;
  const double* color_sums;
  int64_t* near;       // mask of points that clustered samples may reach by themselves
  uint32_t* reaching;  // room for all samples and clusters: those that may reach a block of points,
                       // a cluster as number of samples plus its own
  double* contributions;       // room for three channels of what each gives: samples that are in no
                               // cluster to kShareBlock points, others and clusters to kPad
  ShadowRequest* chosen;       // room for `rays` of each point
  const uint32_t* groups;      // of lights, of each sample; null where nobody asks
  double* const* group_total;  // three columns for each group, to which its contribution is added
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
