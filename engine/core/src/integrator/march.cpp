// Media that vary from place to place: rays in them are cut to cells, and the media's programs run
// once in each (SEMANTICS.md, Media).
#include <algorithm>
#include <cmath>

#include "integrator/media.h"
#include "math/math.h"

namespace glint {
namespace {

constexpr double kGolden = 0.6180339887498949;
constexpr double kMostPairs = 2048;            // of cells of a span, whatever its numbers are
constexpr double kNear = 1.0 / 8;              // of a world's step, how far its cells go at least;
                                               // of the way to them, while that is less than a step
constexpr double kFar = 1.0 / 32;              // of the way to them, where that is more
constexpr double kFarthest = 16384;            // steps of a world; beyond them is one cell more
constexpr double kGauss = 0.5773502691896258;  // 1/√3: of a pair of cells, where they are asked
constexpr double kMostDense = 1e30;            // a world unit
constexpr double kMostAnisotropy = 1 - 1e-3;

/// Which share of a step lies before the first cell.
double shift_of(uint32_t sample) {
  const double turns = 0.5 + kGolden * sample;
  return turns - std::floor(turns);
}

}  // namespace

void MediaSpans::march(const Rays& rays, const double* ends, uint32_t sample, RayKind kind,
                       RayCounts& counts) {
  cells_.clear();
  if (!scene_.varies) return;
  asked_.resize(scene_.media.size());
  for (std::vector<Asked>& asked : asked_) asked.clear();
  const double shift = shift_of(sample);
  everywhere_.assign(rays.count, {0, -kInfinity, kInfinity});
  for (uint32_t k = 0; k < rays.count; ++k) {
    if (world() && world()->program) {
      cut_growing(everywhere_[k], rays.t_min[k], ends[k], world()->step * scene_.anchor.scale,
                  shift);
      ask(everywhere_[k], *world(), k, 0);
    }
    for (size_t i = first_span(k); i < end_[k]; ++i) {
      Span& span = spans_[i];
      const Enclosure& e = scene_.enclosures[span.enclosure];
      if (!scene_.media[e.medium].program) continue;
      cut_evenly(span, std::max(span.from, rays.t_min[k]), std::min(span.to, ends[k]), e.step,
                 shift);
      ask(span, scene_.media[e.medium], k, e.instance);
    }
  }
  for (size_t m = 0; m < asked_.size(); ++m) {
    run(scene_.media[m], asked_[m], rays, kind);
    counts.media_points += asked_[m].size();
  }
}

/// Two halves, asked where Gauss would for the whole; one where it is endless.
void MediaSpans::add_cells(double from, double to) {
  if (!(from < to)) return;
  if (!(to < kInfinity)) return cells_.push_back({from, to, from, {}});
  const double half = 0.5 * (to - from), middle = from + half;
  cells_.push_back({from, middle, middle - kGauss * half, {}});
  cells_.push_back({middle, to, middle + kGauss * half, {}});
}

/// At every second step from where the ray begins, shifted: what is beside it has its cells beside.
void MediaSpans::cut_evenly(Span& span, double from, double to, double step, double shift) {
  span.first_cell = uint32_t(cells_.size());
  const double pair = 2 * step;
  if (from < to && pair > 0 && to < kInfinity && (to - from) / pair < kMostPairs) {
    double number = std::floor(from / pair - shift) + 1 + shift;
    for (; number * pair < to; number += 1) {
      const double next = std::max(number * pair, from);
      add_cells(from, next);
      from = next;
    }
  }
  add_cells(from, to);
  span.cells = uint32_t(cells_.size()) - span.first_cell;
}

/// In steps that grow with the way, to where one cell is the rest.
void MediaSpans::cut_growing(Span& span, double from, double to, double step, double shift) {
  span.first_cell = uint32_t(cells_.size());
  const double begin = from, most = std::min(to - begin, kFarthest * step);
  double next = 2 * shift * kNear * step;
  while (next < most) {
    add_cells(from, begin + next);
    from = begin + next;
    next += 2 * std::max({kNear * step, std::min(step, kNear * next), kFar * next});
  }
  add_cells(from, to);
  span.cells = uint32_t(cells_.size()) - span.first_cell;
}

/// The program is to run in each cell of a span.
void MediaSpans::ask(const Span& span, const Medium& medium, uint32_t ray, uint32_t instance) {
  std::vector<Asked>& asked = asked_[size_t(&medium - scene_.media.data())];
  for (uint32_t i = span.first_cell; i < span.first_cell + span.cells; ++i)
    asked.push_back({ray, i, instance});
}

void MediaSpans::run(const Medium& medium, const std::vector<Asked>& asked, const Rays& rays,
                     RayKind kind) {
  if (asked.empty()) return;
  slots_.resize(size_t(scene_.most_slots) * kBlock);
  InputTables tables = scene_.input_tables();
  if (&medium == world()) tables.instances = &scene_.world_space;  // number 0, as all have it
  ProgramPoints points{};
  for (size_t first = 0; first < asked.size(); first += kBlock) {
    const size_t count = std::min(asked.size() - first, kBlock);
    for (size_t i = 0; i < (count + kPad - 1) / kPad * kPad; ++i) {
      const Asked& at = asked[first + std::min(i, count - 1)];
      const double t = cells_[at.cell].at;
      points.instance[i] = at.instance;
      points.outside[i] = -1;
      points.length[i] = t / scene_.anchor.scale;
      for (size_t c = 0; c < 3; ++c) {
        const double d = rays.d[c][at.ray];
        points.x[c][i] = rays.o[c][at.ray] + t * d;
        points.d[c][i] = d;
        points.g[c][i] = points.n[c][i] = -d;
      }
    }
    stages_.program({tables, medium.program, &points, kind, count, slots_.data(), nullptr});
    for (size_t i = 0; i < count; ++i) {
      Cell& cell = cells_[asked[first + i].cell];
      cell.matter = matter_of(medium, i);
      if (!(cell.to < kInfinity)) cell.matter.emission = {};  // which would be endless
    }
  }
}

/// At point i of the block.
Matter MediaSpans::matter_of(const Medium& medium, size_t i) const {
  const double per = 1 / scene_.anchor.scale;
  const auto color = [&](int32_t slot, Vec3d otherwise, double least) {
    if (slot == 0) return otherwise;
    Vec3d found;
    for (int c = 0; c < 3; ++c) {
      const double value = slots_[(size_t(slot) - 1 + size_t(c)) * kBlock + i];
      found[c] = std::isfinite(value) ? per * std::clamp(value, least, kMostDense) : 0;
    }
    return found;
  };
  Matter matter;
  matter.scattering = color(medium.scattering_slot, medium.scattering, 0);
  matter.extinction = color(medium.absorption_slot, medium.absorption, 0) + matter.scattering;
  matter.emission = color(medium.emission_slot, medium.emission, -kMostDense);
  matter.anisotropy = medium.anisotropy;
  if (medium.anisotropy_slot > 0) {
    const double value = slots_[size_t(medium.anisotropy_slot - 1) * kBlock + i];
    matter.anisotropy =
        std::isfinite(value) ? std::clamp(value, -kMostAnisotropy, kMostAnisotropy) : 0;
  }
  return matter;
}

}  // namespace glint
