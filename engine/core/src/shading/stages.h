// The stages of the pipeline that run over whole batches: camera rays, points on meshes, lobes,
// rays that go on, light from one light sample, shadow rays through surfaces, sums. One source
// (stage_*.h), compiled once per instruction set, with the same bits from each. Plain data only:
// nothing here may emit code. Columns are arrays of one number a ray; they have room for a multiple
// of kPad numbers, and stages may write that far.
#pragma once
#include "shading/light_stages.h"
#include "shading/scene_shapes.h"

namespace glint {

/// Camera rays (notes 4.4-4.6) in anchored space through points of the window and, where lens_x is
/// not null, of the lens. d is unit.
struct CameraStage {
  size_t count;
  const double *across, *upward;  // of each ray's point: u and v of the notes
  double u[3], v[3], w[3];        // columns of world_from_camera
  double scale, clip_start, clip_end;
  bool parallel;
  const double *lens_x, *lens_y;  // along u and v
  double bend;                    // of the slopes, per length on the lens: one over its focus
  const double*
      frame[12];     // world_from_camera of each ray, row by row; null where all have u, v, w
  double origin[3];  // of anchored space
  double *o[3], *d[3], *t_min, *t_max;  // o: only where it is not the eye of all
  double *latest, *earliest;            // the largest t_min and the least t_max; not of panoramas
  const GlintCamera* panorama;          // null for none; its rays that see nothing end at -1
  const GlintCamera* eye;               // null where the camera's place is the eye
};

/// Rays and hits to points. Rays that hit nothing get the material `missed`, other hits than of
/// meshes kNoMaterial.
struct SurfaceStage : BatchColumns {
  size_t count;
  const InstanceShape* instances;
  const GroupShape* groups;
  uint32_t missed;
};

/// Constant lobes. Writes every column of the sums; `diffuse`, `specular` and `lit` say what lights
/// are to add.
struct ShadeStage : BatchColumns {
  size_t count;
  const MaterialTerms* terms;
  const double* specular_terms;  // specular_columns a material
  size_t specular_columns;
  const LobeSpan* rows;  // of these; as many as may have something to these rays
  size_t row_count;
  const LobeLayout* lobes;
  int highlights;            // as LobeColumns has it
  const double* view_terms;  // max_view rows a material
  int max_view;
  double ambient[3];  // the world's, read with lowering
  SumColumns sums;
};

/// A program over a block of points. slots: kBlock numbers each, what they hold afterwards is what
/// its outputs are read from.
struct ProgramStage {
  InputTables tables;
  const ProgramShape* program;
  const ProgramPoints* points;
  RayKind kind;
  size_t count;
  double* slots;
  const RayQueries* queries;  // null where no rays can be asked for
};

/// The coefficient of one lobe at the points of a block. Finite.
struct CoefficientStage {
  InputTables tables;
  const ProgramPoints* points;
  size_t count;
  const double* slots;  // of the material's program at these points; null for none
  const LobeShape* lobe;
  double* k[3];
};

/// One material that varies over the surface or sends rays on. Adds to the sums; sets `diffuse`,
/// `specular` and `lit`, as ShadeStage does, and `passing`; `translucent` and `below` are null
/// where the material has no such lobes.
struct EvaluateStage : BatchColumns {
  InputTables tables;
  size_t count;
  const uint32_t* rows;         // of its points
  const ProgramShape* program;  // null for none, as what follows
  RayKind kind;
  double* slots;
  const RayQueries* queries;
  int32_t normal;      // 0, or 1 plus the slot of the normals that take the place of `n`
  int bump_shadowing;  // GlintBumpShadowing; base_normal: as `normal`, what that was bent from
  int32_t base_normal;
  const LobeShape* lobes;
  uint32_t lobe_count;
  bool dark;      // EMISSION lobes show nothing
  double thrown;  // exponent of the SPECULAR lobes that MIRROR ones are as well, 0: of none
  double ambient[3];
  SumColumns sums;
  const LobeLayout* layout;  // of `specular`
};

/// Rays that leave points which share a material. Of a path's rays those of the lobes come in the
/// lobes' order: refracted ones, then one mirrored, then one that goes straight on.
struct PassStage : BatchColumns {
  size_t count;
  const uint32_t* rows;  // of the points, of different paths
  const LobeShape* lobes;
  uint32_t lobe_count, max_bounces, max_straight, splits;
  bool shares;  // rays keep their probability, if each surface chose one (RayColumns::share)
  double cutoff;
  double least, choice;  // after more than `splits` bounces rays go on that weigh as much, of
                         // others a part, by a number of the sample; least 0: all do  // of weights
  /// Where in rough REFRACTION lobes rays go on, after depth % levels bounces.
  const DiscPlace* places;
  uint32_t levels;
  RayEnd straight, bounced;  // room for each row, and for each row and lobe
};

struct PassedRays {
  size_t refraction, mirror, transparent;
};

/// What surfaces of one material let through of the shadow rays of a light sample.
struct TransmittanceStage {
  InputTables tables;
  size_t first, count;  // rows of the columns of hits
  const GroupShape* shapes;
  const uint32_t* number;  // of the ray in the sample; rays have several hits
  const uint32_t *instance, *primitive;
  float *u, *v;
  const uint32_t* point;  // of each ray of the sample, as what follows but `origin`
  const double *origin[3], *to[3],
      *end[3];  // origin: of each point, where `start` is null.  end: null where `to` is exact
  const double* start[3];
  double* share[3];  // of each hit
  double* narrowed;  // by how much; null where surfaces are of no density
  double* bent[3];   // and by how much these change its optical momentum
  RayKind kind;
  const LobeShape* lobes;
  uint32_t lobe_count;
  const ProgramShape* program;  // null for none
  double* slots;
  const double* solids;  // of hits on what is no mesh, where the scene has such: eight numbers a
                         // row: x, g, 1 where the outer side is seen, and how far along it is
};

struct Stages {
  const char* name;
  void (*camera)(const CameraStage&);
  void (*surface)(const SurfaceStage&);
  size_t (*shade)(const ShadeStage&);    // how many `others`
  size_t (*vary)(const EvaluateStage&);  // how many `passing_rows`
  void (*program)(const ProgramStage&);
  void (*coefficients)(const CoefficientStage&);
  PassedRays (*pass)(const PassStage&);
  void (*dome)(const DomeStage&);
  /// How many points the sample reaches; the same of points that lie on no surface; how many the
  /// directions drawn from their lobes light.
  size_t (*light)(const LitPoints&, const LampSample&, const ShadowRays&);
  size_t (*scatter)(const LitPoints&, const LampSample&, const ShadowRays&);
  size_t (*gloss)(const LitPoints&, const LampSample&, const ShadowRays&);
  /// How many points have a ray that looks for what throws light on them; that reflects others, in
  /// whose t_max is the exponent of the lobe.
  size_t (*gather)(const OnwardStage&);
  size_t (*reflect)(const OnwardStage&);
  size_t (*share)(const ShareStage&);  // how many `chosen`
  void (*transmit)(const TransmittanceStage&);
  void (*sum)(const LightSum&);
  void (*sum_parts)(const LightParts&);
  void (*add)(double* to, const double* from, size_t count);
  void (*mean)(const double* sums, double samples, float* out,
               size_t count);  // NaN becomes 0, infinities the largest float
  void (*cosine_power)(const double* tangent2, const double* exponent, double* out, size_t count);
};

#if defined(GLINT_X86_KERNELS)
extern const Stages stages_sse42, stages_avx2, stages_avx512;
#else
extern const Stages stages_generic;
#endif

/// The stages for this machine; GLINT_ISA (sse42, avx2, avx512) takes others where the machine has
/// them.
const Stages& best_stages();

}  // namespace glint
