// What a render was asked for, and what its rays report back.
#pragma once
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "bvh/accel.h"
#include "film/film.h"
#include "scene/light.h"

namespace glint {

class PhotonMap;
struct Scene;

/// Numbers of a row of the tables of lights that are places in the scene (glint.h).
constexpr size_t kPointColumns = 18;

/// The light group of a row of such a table, which may hold anything.
inline int group_of_row(const double* row) {
  const double group = row[kPointColumns - 1];
  return group >= 1 && group <= 64 ? int(group) - 1 : -1;
}

/// A table of what the samples of pixels draw: `each` rows of so many numbers for one sample, those
/// of `tabled` samples in turn.
struct SampleTable {
  const double* numbers = nullptr;
  size_t columns = 1;
  uint32_t each = 1, tabled = 1;

  /// Of `count` rows.
  SampleTable() = default;
  SampleTable(const double* table, size_t width, uint32_t rows, uint64_t count)
      : numbers(table),
        columns(width),
        each(std::max(rows, 1u)),
        tabled(uint32_t(std::max(count / each, uint64_t(1)))) {}
  size_t number(uint32_t sample, uint32_t j) const { return size_t(sample % tabled) * each + j; }
  const double* row(uint32_t sample, uint32_t j) const {
    return numbers + columns * number(sample, j);
  }
};

/// The settings, and what follows from them.
struct RenderPlan : GlintRenderSettings {
  /// One sample of nothing.
  RenderPlan() : GlintRenderSettings{} {
    samples = visibility_samples = light_samples = lobe_levels = 1;
  }
  /// The settings have no problems.
  RenderPlan(const GlintRenderSettings& settings, const Scene& scene);

  /// Mirror and glass send all of their rays after so many bounces; then those that weigh less than
  /// that by chance.
  static constexpr uint32_t kSplits = 2;
  static constexpr double kLeastWeight = 1.0 / 8;
  static constexpr uint32_t kBounceParts = 4;  // of a class of pixels, that deal bounces
  // Largest exponent of gloss at what rays of bounced light meet: few would find a narrower lobe's
  // light, and show it as dots. Cycles' Filter Glossy of 1 comes to as much. That of mirrors there,
  // whose shape is lost in any case.
  static constexpr double kBouncedExponent = 8, kThrownExponent = 2;

  /// In place of the settings' four numbers. shown: the pixels that were asked for.  traced: with
  /// those that light is averaged with; the region has a margin where the neighbours of these are
  /// looked at.
  Region region{}, traced{}, shown{};
  bool reflects_gloss = false;  // rough surfaces send rays towards others
  int thread_count = 1;
  SampleTable dome_directions, occlusion_directions, subsurface_places;
  SampleTable mesh_points;    // of the first mesh light, and after its mesh_count those of the next
  SampleTable medium_points;  // the same of medium lights
  SampleTable opening_places;  // where there are openings
  size_t lobe_tabled = 1;      // lobe_levels runs of so many lobe_points
  DomeCells dome;
  std::shared_ptr<const std::vector<Opening>> opening_rows;  // also of copies
  Openings open;

  /// For the ray by which a path bounces after so many bounces: where in the unit disc below its
  /// direction, and by what share of its light it may be left out.
  /// part: of the pixel.
  const double* bounce_point(uint32_t sample, uint32_t bounced, uint32_t part) const {
    const size_t level = bounced % std::max(bounce_levels, 1u);
    const uint32_t run = std::bit_ceil(samples);
    const uint64_t number =
        interleaving > 1 ? (uint64_t(kBounceParts) * (sample / run) + part) * run + sample % run
                         : sample;
    return bounce_points + 3 * (level * bounce_count + number % bounce_count);
  }
  uint32_t fibre_bounces;  // as often at most light bounces; what is matt throws it on less often
  /// Bounces are dealt over blocks twice as wide: which part of the run of its class a pixel of the
  /// region has.
  uint32_t bounce_part(uint32_t pixel) const {
    if (interleaving <= 1) return 0;
    const uint32_t column = region.x0 + pixel % region.width(),
                   row = region.y0 + pixel / region.width();
    const uint32_t x = (column & interleaving) != 0, y = (row & interleaving) != 0;
    return 2 * (x ^ y) + y;
  }

  /// What of the light of a pixel's points a sample brings back from below the surface.
  const double* subsurface_point(uint32_t sample) const { return subsurface_places.row(sample, 0); }

  /// Which class of its block a pixel of the frame is in: neighbours get numbers far apart, as
  /// ordered dither has them (Bayer 1973).
  uint32_t interleaving_class(uint32_t column, uint32_t row) const {
    uint32_t number = 0;
    for (uint32_t bit = 1; bit < interleaving; bit *= 2) {
      const uint32_t x = (column & bit) != 0, y = (row & bit) != 0;
      number = 4 * number + 2 * (x ^ y) + y;
    }
    return number;
  }
  /// Which sample of the tables a pixel of a class takes as its `sample`: an aligned run of them is
  /// its own, which it goes through from another one on, so that the first samples of all classes
  /// are spread well too (Keller, Heidrich 2001, Interleaved sampling).
  uint32_t dealt_sample(uint32_t sample, uint32_t number) const {
    if (interleaving <= 1) return sample;
    constexpr uint32_t kTurns[] = {6, 4, 8, 13};  // of engine/sampling
    const uint32_t run = std::bit_ceil(samples);
    uint32_t first = 0;
    for (uint32_t bit = 0; bit < 4; ++bit) first ^= number >> bit & 1 ? kTurns[bit] : 0;
    return number * run + (sample ^ (first & (run - 1)));
  }
  /// The same of camera ray `past` after the samples of a pixel: one of another class, for four
  /// classes the same, as no shadow comes of it.
  uint32_t sample_beyond(uint32_t past, uint32_t number) const {
    const uint32_t classes = interleaving * interleaving;
    const uint32_t other = (number & ~3u) ^ ((classes / 2 + 1 + past / samples) % classes);
    return dealt_sample(past % samples, other);
  }

  bool physical() const { return illumination == GLINT_PHYSICAL; }

  /// Whether photons are asked for.
  bool throws_photons() const {
    return photons > 0 && physical() && bounces > 0 && max_bounces > 0 &&
           (reflective_caustics || refractive_caustics);
  }
  std::shared_ptr<const PhotonMap> photon_map;  // null: there are no photons

  uint32_t samples_of(const Light& light) const {
    if (light.is_mesh()) return mesh_points.each;
    if (light.is_medium()) return medium_points.each;
    return light.is_dome() ? dome_directions.each : light.extended ? light_samples : 1;
  }

  /// Points on openings that surfaces take beside a light's own samples.
  uint32_t opening_samples_of(const Light& light) const {
    return light.is_dome() && open.count > 0 ? opening_places.each : 0;
  }

  /// In how many parts a light's samples are taken, one by each pixel sample in turn: what gather
  /// rays and reflections of rough surfaces meet is seen blurred, and asks for a part of the sky
  /// alone; of strands each sample of a pixel meets others, and what is faint adds little, so that
  /// these ask for few of all lights that have tables.
  uint32_t parts_of(const Light& light, bool blurred, bool few) const {
    constexpr uint32_t blurred_parts = 2, few_parts = 4;
    const bool tabled = light.is_dome() || light.is_tabled();
    if (!(few ? tabled : blurred && light.is_dome())) return 1;
    const uint32_t parts = few ? few_parts : blurred_parts;
    const bool whole = samples_of(light) % parts != 0 || opening_samples_of(light) % parts != 0;
    return whole ? 1 : parts;
  }

  /// Point j on the openings of a dome for pixel sample `sample`.
  OpeningPoint opening_point(uint32_t sample, uint32_t j) const {
    const double* const row = opening_places.row(sample, j);
    const Opening& on = open.rows[std::min(size_t(row[0]), open.count - 1)];
    OpeningPoint point;
    for (int c = 0; c < 3; ++c) {
      point.at[c] = on.center[c] + row[1] * on.right[c] + row[2] * on.up[c];
      point.normal[c] = on.normal[c];
    }
    return point;
  }

  /// Sample j of a light for surfaces, those on openings after its own.
  LightPoint set_sample(LampSample& lamp, const Light& light, uint32_t sample, uint32_t j,
                        uint32_t parts = 1) const {
    const uint32_t count = samples_of(light);
    const LightPoint point = light_point(light, sample, j < count ? j : 0, parts);
    lamp.light = light.sample(point, count, physical(), lamp.policy);
    if (opening_samples_of(light) == 0) return point;
    lamp.light.shape = LightShape::kOpenDome;
    lamp.light.openings = &open;
    lamp.light.through = j >= count;
    if (!lamp.light.through) return point;
    const OpeningPoint on = opening_point(sample, j - count);
    std::copy_n(on.at, 3, lamp.light.dome.end);
    std::copy_n(on.normal, 3, lamp.light.axis);
    LightPoint through = point;
    through.draws = false;
    through.met_by = kDiffuse;
    return through;
  }

  /// Where along rays point `number` of `count` lies that media scatter light from, in (0, 1)
  /// (engine/sampling.py, scatter_share).
  double scatter_share(uint32_t sample, uint32_t number, uint32_t count) const {
    const double cells = double(std::bit_ceil(scatter_count)),
                 own = ((number + 0.5) / count - 0.5) / cells,
                 share = double(number) / count + scatter_offsets[sample] + own;
    return share - std::floor(share);
  }

  /// Where in a pixel of the frame its camera rays go: of its samples, then of the rest.
  const double* offsets_of(uint32_t column, uint32_t row) const {
    uint32_t number = 0;
    for (uint32_t bit = 2; bit > 0; bit /= 2) {
      const uint32_t x = (column & bit) != 0, y = (row & bit) != 0;
      number = 4 * number + 2 * (x ^ y) + y;
    }
    return pixel_offsets + 2 * size_t(number % visibility_samples) * samples * visibility_samples;
  }

  /// Camera rays of a pixel beyond its samples, which light does not follow.
  uint32_t beyond_samples() const { return samples * (visibility_samples - 1); }

  /// Whether the samples of a pixel look from different places.
  bool is_spread() const { return lens_points || camera_frames; }

  /// Where in the lobes of rough surfaces a sample is reflected that was so often before.
  const double* lobe_point(uint32_t sample, uint32_t reflected) const {
    return lobe_points + 2 * (reflected % lobe_levels * lobe_tabled + sample % lobe_tabled);
  }

  /// The first sample of a pixel of the frame in the tables of the camera.
  size_t camera_row(size_t column, size_t row) const {
    return (row % camera_block * camera_block + column % camera_block) * samples;
  }

  /// Point j of a light for pixel sample `sample`, which takes one of so many parts of them. Beside
  /// every `dome.every` of a dome's that are taken highlights draw one, at places of which those of
  /// one number in all samples are a net.
  LightPoint light_point(const Light& light, uint32_t sample, uint32_t j,
                         uint32_t parts = 1) const {
    if (light.is_dome()) {
      const uint32_t each = dome_directions.each / parts;
      const size_t from = sample % dome_directions.tabled, taken = from * each + j % each,
                   drawn = j % each / dome.every * dome_directions.tabled + from;
      const double* const row = dome_directions.row(sample, j);
      const double* const place = dome_directions.numbers + kDomeColumns * drawn + 7;
      LightPoint point{0, 0, place[0], place[1], row, &dome, taken % dome.every == 0};
      point.group = light.group;
      point.met_by = row[9] != 0 ? kShadow : kDiffuse;
      return point;
    }
    if (light.is_mesh()) {
      const double* const row =
          mesh_points.row(sample, j) + kPointColumns * light.table_number * size_t(mesh_count);
      return {0, 0, row[14], row[15], row, nullptr, j == 0, group_of_row(row)};
    }
    if (light.is_medium()) {
      const double* const row =
          medium_points.row(sample, j) + kPointColumns * light.table_number * size_t(medium_count);
      return {0, 0, 0, 0, row, nullptr, false, group_of_row(row)};
    }
    LightPoint point;
    point.group = light.group;
    if (light_samples <= 1 || !light_square || !light.extended) return point;
    const size_t at = 2 * (size_t(sample) * light_samples + j);
    point.a = light_square[at];
    point.b = light_square[at + 1];
    point.x = light_disc[at];
    point.y = light_disc[at + 1];
    return point;
  }
};

/// Rays, the time they took, and points at which the programs of media ran.
struct RayCounts {
  uint64_t camera = 0, shadow = 0, mirror = 0, refraction = 0, transparent = 0, gather = 0,
           probe = 0, media_points = 0;
  double tracing = 0;  // seconds in the accelerator
  RayCounts& operator+=(const RayCounts& b) {
    tracing += b.tracing;
    camera += b.camera;
    shadow += b.shadow;
    mirror += b.mirror;
    refraction += b.refraction;
    transparent += b.transparent;
    gather += b.gather;
    probe += b.probe;
    media_points += b.media_points;
    return *this;
  }
};

}  // namespace glint
