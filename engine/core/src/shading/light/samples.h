// One sample of one light, and what counts of it. Plain data only: nothing here may emit code.
#pragma once
#include <cstddef>
#include <cstdint>

namespace glint {

/// How samples of a light lie round points: each has a header of its own, and a place below.
enum class LightShape : int {
  kSun,
  kPoint,
  kSphere,
  kDisc,
  kArea,
  kRectangle,
  kDome,
  kOpenDome,
  kMesh,
  kMedium
};

constexpr bool is_dome(LightShape shape) {
  return shape == LightShape::kDome || shape == LightShape::kOpenDome;
}
/// Whether its shadow rays have no end.
constexpr bool is_endless(LightShape shape) { return shape == LightShape::kSun || is_dome(shape); }

/// Of the least square of the distance of a mesh light's points, that of what draws directions to
/// them.
constexpr double kNearest = 1e-12;

constexpr size_t kDomeColumns = 10;  // of rows of GlintRenderSettings.dome_table

/// A point of the unit disc: its direction and the square of its distance from the middle.
struct DiscPlace {
  double azimuth[2], radius2;
};
inline DiscPlace disc_place(double x, double y) {
  const double r2 = x * x + y * y, r = __builtin_sqrt(r2);
  return {{r > 0 ? x / r : 1, r > 0 ? y / r : 0}, r2};
}

/// A dome's maps (glint.h). every: of its directions highlights draw one beside so many.
struct DomeCells {
  const float *cells = nullptr, *irradiance = nullptr;
  size_t rows = 0, columns = 0, irradiance_rows = 0, irradiance_columns = 0;
  double axes[3][3] = {};
  size_t every = 1;
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

/// l: the unit direction. versine: 1 - cos of the half angle.
struct SunPlace {
  double l[3], versine;
};

/// Of spheres, discs and points, whose radius is 0. x, y: the sample in the unit disc.
struct RoundPlace {
  double radius, x, y;
};

/// The part of an area light that is seen large from near by is sampled by solid angle. right, up:
/// unit axes. size: half the diagonal; half: half the sides over it. near2: the square of the
/// distance within which it is seen large. a, b: the sample in the square.
struct RectanglePlace {
  double right[3], up[3], size, half[2], near2, a, b;
};

/// end: the sample, uniform over the area. across, upward: what takes its sides, or axes, to 1.
/// tan_spread, even_spread: as light.h has them.
struct AreaPlace {
  double end[3], area, across[3], upward[3], tan_spread, even_spread;
  RectanglePlace rectangle;
};

/// l: the unit direction; of a sample through an opening: end, the point there, whose normal is the
/// sample's axis.
struct DomePlace {
  double l[3], end[3];
};

/// The sample is the centre. near2: the least distance^2 that it is seen from. reach: how far
/// before the surface segments end.
struct MeshPlace {
  double near2, reach;
};

/// The sample is the centre of a ball. near2: of its radius.
struct MediumPlace {
  double near2;
};

/// What the shadow rays of a sample depend on. Doubles alone, so that bytes tell whether two are
/// alike.
struct SamplePlace {
  double center[3], axis[3];
  union {
    AreaPlace area;  // the largest: {} clears them all
    SunPlace sun;
    RoundPlace round;
    DomePlace dome;
    MeshPlace mesh;
    MediumPlace medium;
  };
};

struct SpotCone {
  bool on;
  double cosine, width;
};

/// Where directions towards the light are drawn from lobes whose exponent at the distance d is
/// least_near d^2 + least or more, and at which point of a lobe.
struct LobeDraws {
  bool on;
  double least_near, least;
  DiscPlace place;
};

/// A sample as light.h has it for one point. The radiant intensity from it is color (of a mesh's
/// inner side back) times factor over the number of the light's samples. inverse_pdf: one over the
/// pdf of its points: by solid angle of suns and domes, by area of meshes, by volume of media.
struct LightSample : SamplePlace {
  LightShape shape;
  bool physical, ellipse, through;  // through: a dome's point on an opening
  double color[3], back[3], factor, inverse_pdf, count, scale2;
  SpotCone spot;
  LobeDraws draws;
  const DomeCells* dome_cells;
  const Openings* openings;
};

/// What counts of a light. draws: highlights draw directions to it besides, where it is large;
/// most_exponent: of these. draws_diffuse: what is matt does so too.
struct LightPolicy {
  bool casts_shadow, on_diffuse, on_glossy, draws, draws_diffuse, power_heuristic;
  double most_exponent;
};

/// What stages light points by. lit: the mask of points that it may reach.  drawn: it is directions
/// that lobes draw in its place.
struct LampSample {
  LightSample light;
  LightPolicy policy;
  const int64_t* lit;
  bool drawn;
};

}  // namespace glint
