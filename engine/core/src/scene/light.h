// Lights in anchored space: how they illuminate a point, and what a ray that meets their shape
// sees.
#pragma once
#include <vector>

#include "bvh/accel.h"
#include "glint.h"
#include "math/vec.h"
#include "shading/stages.h"

namespace glint {

struct Anchor;
struct ProgramTable;

/// A point of the square [-1, 1]^2 and the same point mapped to the unit disc; of a dome the
/// direction to its light, what comes from there and one over the density of such directions, and
/// its map; of a tabled light a row of its table (glint.h).
struct LightPoint {
  double a = 0, b = 0, x = 0, y = 0;
  const double* drawn = nullptr;
  const DomeCells* dome = nullptr;
  bool draws = true;          // highlights draw a direction there
  int group = -1;             // of lights that its own is in; -1 for none
  uint32_t met_by = kShadow;  // what rays of surfaces to it meet
};

/// Where a ray hits a mesh light, as its point sees that: the radiance and its factor, where shadow
/// rays end before it, and one over the pdf of the light's points there (a steradian).
struct EmitterHit {
  Vec3d color, end;
  double factor, inverse_pdf, whole;  // whole: inverse_pdf, seen from as near as it is
  bool front;                         // the outer side is seen
};

/// The direction at the disc point (x, y) of the cone round `axis` with 1 - cos(half angle) =
/// versine, uniform in solid angle.
Vec3d direction_in_cone(Vec3d axis, double versine, const LightPoint& p);

struct Light {
  int kind = GLINT_POINT_LIGHT;
  uint32_t flags = 0;
  uint64_t excluded_sets = 0;     // a bit for each light_set of what it does not light
  uint64_t passed_sets = 0;       // and of what casts no shadow in it
  Vec3d color;                    // c = color * strength
  Vec3d center, axis, right, up;  // right, up: the area's half extents along its x and y
  double radius = 0;
  double scale2 =
      1;  // (anchored length / world length)^2: inverse squares are taken in world units
  double versine = 0;  // 1 - cos of the sun's half angle
  double spot_cosine = -1, spot_sine = 0, spot_blend = 0;
  double tan_spread = 0, even_spread = 0;  // of an area light that shines in a cone: the tangent T
                                           // of its half angle h, and 1 / (T - h); else 0
  Vec3d seen;                              // radiance of the visible shape
  int group = -1;                          // of lights, but of those on surfaces; -1 for none
  int level = -1;                          // in the tree of clusters, as GlintLight has it
  bool extended = false;                   // has more than one sample when the settings want them
  uint32_t number = 0;                     // among the scene's lights
  uint32_t table_number = 0;               // of a mesh or medium light, among those of its kind
  size_t first_emitter = 0, emitter_count = 0;  // of the scene's, that are a mesh light
  const ProgramShape* program = nullptr;        // what color is times at each sample; null: 1
  size_t slot = 0;                              // in the block of its slots
  InstanceShape space{};                        // its axes, as programs read those of an object
  Affine placed;                                // the same for the points of one that is tabled

  Light(const GlintLight& data, const Anchor& anchor, const ProgramTable& programs);
  bool endless() const { return kind == GLINT_SUN || is_dome(); }
  bool is_dome() const { return kind == GLINT_DOME; }
  bool is_mesh() const { return kind == GLINT_MESH_LIGHT; }
  /// A medium that glows.
  bool is_medium() const { return kind == GLINT_MEDIUM_LIGHT; }
  /// Whether its samples are places in the scene, rows of a table.
  bool is_tabled() const { return is_mesh() || is_medium(); }
  bool lights_all() const { return excluded_sets == 0; }
  bool lights(uint32_t light_set) const { return !(excluded_sets >> light_set & 1); }
  /// Whether far points see it in a cluster with others.
  bool is_clustered() const {
    return level >= 0 && kind == GLINT_POINT_LIGHT && !program && lights_all() && lights_matt() &&
           lights_gloss() && casts_shadow() && color.x >= 0 && color.y >= 0 && color.z >= 0 &&
           any(color);
  }
  bool lights_matt() const { return !(flags & GLINT_NOT_ON_MATT); }
  bool lights_gloss() const { return !(flags & GLINT_NOT_ON_GLOSS); }
  bool lights_media() const { return !(flags & GLINT_NOT_IN_MEDIA); }
  /// Whether its shape is seen in mirrors and not through glass, or the other way.
  bool glass_differs() const {
    return any(seen) && !(flags & GLINT_SEEN_BY_MIRROR) != !(flags & GLINT_SEEN_BY_TRANSMISSION);
  }
  bool casts_shadow() const { return flags & GLINT_CAST_SHADOW; }

  /// What counts of it where all that is known is the light.
  LightPolicy policy() const;
  /// Sample `p` of `count` (1: the centre).
  LightSample sample(const LightPoint& p, uint32_t count, bool physical,
                     const LightPolicy& policy) const;

  /// What of a spot's or an area light's radiance leaves along the unit vector d.
  double along(Vec3d d, bool physical) const;
  /// From where to where it shines on a line.
  struct Part {
    double from, to;
  };
  Part lit_part(Vec3d o, Vec3d d) const;
  /// Half of how near it is before it seems no brighter; but for tabled lights.
  double nearness() const {
    return kind == GLINT_AREA ? 0.5 * std::sqrt(dot(right, right) + dot(up, up)) : 0.5 * radius;
  }

  /// Whether the horizon of the point x, the plane through it across n, cuts the light's shape, and
  /// the light shines that way.
  bool is_cut(Vec3d x, Vec3d n) const;

  /// The place q on an emitter as x sees it in the direction l, beside `count` points a sample;
  /// shadow rays to it start at `origin`.
  EmitterHit emitter_hit(const GlintEmitter& emitter, Vec3d x, Vec3d origin, Vec3d q, Vec3d l,
                         uint32_t count) const;

  /// Ray parameter at which o + t d (d unit) first meets the visible shape, infinity for the sun's
  /// disc, negative for never.
  double meets(Vec3d o, Vec3d d) const;
  /// Where its program is asked what such a ray sees: a light of soft falloff is a disc there.
  Vec3d seen_point(Vec3d o, Vec3d d, double meets) const;
  /// What a ray along the unit vector d sees there; 0 behind an area light.
  Vec3d radiance(Vec3d o, Vec3d d, bool physical) const;

 private:
  LightSample wide_sample(LightShape shape, const LightPoint& p, uint32_t count,
                          const LightPolicy& policy) const;
  LightSample dome_sample(const LightPoint& p, uint32_t count, const LightPolicy& policy) const;
  LightSample tabled_sample(const LightPoint& p, uint32_t count, const LightPolicy& policy) const;
  LightSample lamp_sample(const LightPoint& p, uint32_t count, bool physical,
                          const LightPolicy& policy) const;
  bool has_extent() const;
  LightShape shape(bool soft, bool physical) const;
  AreaPlace area_place(const LightPoint& p, bool physical) const;
  LobeDraws lobe_draws(const LightPoint& p, bool soft, const LightPolicy& policy) const;
  double area() const;
  double spot(double z) const;
  Part within_cone(Vec3d o, Vec3d d, double cosine2) const;
  double meets_sphere(Vec3d o, Vec3d d) const;
  double meets_area(Vec3d o, Vec3d d) const;
};

struct LightTable {
  std::vector<Light> rows;
  std::vector<GlintEmitter> emitters;
  const float* emitter_corners = nullptr;
  size_t dropped = 0;

  size_t size() const { return rows.size(); }
  const Light& operator[](size_t number) const { return rows[number]; }
  auto begin() const { return rows.begin(); }
  auto end() const { return rows.end(); }
};

/// Leaves out lights that have numbers that are not finite, or no axis.
LightTable place_lights(const GlintSceneData& data, const Anchor& anchor,
                        const ProgramTable& programs);

}  // namespace glint
