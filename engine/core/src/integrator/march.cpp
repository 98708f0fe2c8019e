// Media that vary from place to place: rays in them are cut to cells, and the media's programs run
// once in each (semantics/media.md).
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
constexpr double kShadowSteps = 2;             // of rays to lights, over those of others
constexpr double kOpaque = 12;                 // optical depth beyond which it is dark
constexpr uint32_t kAskedAtOnce = 32;          // cells of a ray
constexpr double kMostDense = 1e30;            // a world unit
constexpr double kMostAnisotropy = 1 - 1e-3;

/// Which share of a step lies before the first cell.
double shift_of(uint32_t sample) {
  const double turns = 0.5 + kGolden * sample;
  return turns - std::floor(turns);
}

}  // namespace

void MediaSpans::march(const Rays& rays, const double* ends, uint32_t sample, RayKind kind,
                       RayCounts& counts, bool to_end) {
  cells_.clear();
  summed_ = false;
  if (!scene_.media.varies) return;
  const double shift = shift_of(sample), coarse = kind == RayKind::kShadow ? kShadowSteps : 1;
  everywhere_.assign(rays.count, {0, -kInfinity, kInfinity});
  going_.clear();
  order_.clear();
  for (uint32_t k = 0; k < rays.count; ++k) {
    const uint32_t first = uint32_t(cells_.size());
    cut(rays, k, ends, shift, coarse);
    const uint32_t end = uint32_t(cells_.size());
    if (first == end) continue;
    for (uint32_t i = first; i < end; ++i) order_.push_back(i);
    const auto before = [&](uint32_t i, uint32_t j) { return cells_[i].from < cells_[j].from; };
    if (!std::is_sorted(order_.begin() + first, order_.end(), before))
      std::stable_sort(order_.begin() + first, order_.end(), before);
    going_.push_back({k, first, end, {}});
  }
  ask_in_turn(rays, kind, to_end, counts);
}

/// The spans of a ray in media that vary.
void MediaSpans::cut(const Rays& rays, uint32_t ray, const double* ends, double shift,
                     double coarse) {
  if (world() && world()->program) {
    Span& span = everywhere_[ray];
    cut_growing(span, rays.t_min[ray], ends[ray], coarse * world()->step * scene_.anchor.scale,
                shift, coarse);
    end_span(span, *world(), 0);
  }
  for (size_t i = first_span(ray); i < end_[ray]; ++i) {
    Span& span = spans_[i];
    const Enclosure& e = scene_.media.enclosures[span.enclosure];
    if (!scene_.media[e.medium].program) continue;
    cut_evenly(span, std::max(span.from, rays.t_min[ray]), std::min(span.to, ends[ray]),
               coarse * e.step, shift);
    end_span(span, scene_.media[e.medium], e.instance);
  }
}

/// Its cells are those from `first_cell` on, of a medium.
void MediaSpans::end_span(Span& span, const Medium& medium, uint32_t instance) {
  span.cells = uint32_t(cells_.size()) - span.first_cell;
  for (size_t i = span.first_cell; i < cells_.size(); ++i) {
    cells_[i].medium = uint32_t(&medium - scene_.media.rows.data());
    cells_[i].instance = instance;
  }
}

/// Runs the programs along the rays, so many cells of each at a time, up to where it is dark.
void MediaSpans::ask_in_turn(const Rays& rays, RayKind kind, bool to_end, RayCounts& counts) {
  asked_.resize(scene_.media.rows.size());
  while (!going_.empty()) {
    for (std::vector<Asked>& asked : asked_) asked.clear();
    const auto asked_of = [&](const Going& g) {
      return to_end ? g.end : std::min(g.end, g.next + kAskedAtOnce);
    };
    for (const Going& g : going_)
      for (uint32_t i = g.next; i < asked_of(g); ++i)
        asked_[cells_[order_[i]].medium].push_back({g.ray, order_[i]});
    for (size_t m = 0; m < asked_.size(); ++m) {
      run(scene_.media[m], asked_[m], rays, kind);
      counts.media_points += asked_[m].size();
    }
    size_t kept = 0;
    for (Going& g : going_) {
      if (to_end || is_dark(g, asked_of(g))) continue;
      if (g.next < g.end) going_[kept++] = g;
    }
    going_.resize(kept);
  }
}

/// Takes in what was asked up to a place; where little enough gets through, nothing does beyond.
bool MediaSpans::is_dark(Going& going, uint32_t asked) {
  for (; going.next < asked; ++going.next) {
    const Vec3d& depth = going.depth;
    if (std::min({depth.x, depth.y, depth.z}) > kOpaque) break;
    const Cell& cell = cells_[order_[going.next]];
    const double way = cell.to - cell.from;
    for (int c = 0; c < 3; ++c)
      if (cell.matter.extinction[c] > 0) going.depth[c] += cell.matter.extinction[c] * way;
  }
  if (going.next == asked) return false;
  Matter wall;
  wall.extinction = {kMostDense, kMostDense, kMostDense};
  for (uint32_t i = going.next; i < going.end; ++i) cells_[order_[i]].matter = wall;
  return true;
}

/// Two halves, asked where Gauss would for the whole; one where it is endless.
void MediaSpans::add_cells(double from, double to) {
  if (!(from < to)) return;
  if (!(to < kInfinity)) return cells_.push_back({from, to, from, 0, 0, {}});
  const double half = 0.5 * (to - from), middle = from + half;
  cells_.push_back({from, middle, middle - kGauss * half, 0, 0, {}});
  cells_.push_back({middle, to, middle + kGauss * half, 0, 0, {}});
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
}

/// In steps that grow with the way, to where one cell is the rest.
void MediaSpans::cut_growing(Span& span, double from, double to, double step, double shift,
                             double coarse) {
  span.first_cell = uint32_t(cells_.size());
  const double begin = from, most = std::min(to - begin, kFarthest * step);
  const double near = coarse * kNear, far = coarse * kFar;
  double next = 2 * shift * near * step;
  while (next < most) {
    add_cells(from, begin + next);
    from = begin + next;
    next += 2 * std::max({near * step, std::min(step, near * next), far * next});
  }
  add_cells(from, to);
}

void MediaSpans::run(const Medium& medium, const std::vector<Asked>& asked, const Rays& rays,
                     RayKind kind) {
  if (asked.empty()) return;
  slots_.resize(size_t(scene_.programs.most_slots) * kBlock);
  InputTables tables = scene_.input_tables();
  if (&medium == world()) tables.instances = &scene_.media.world_space;  // number 0, as all have it
  ProgramPoints points{};
  for (size_t first = 0; first < asked.size(); first += kBlock) {
    const size_t count = std::min(asked.size() - first, kBlock);
    for (size_t i = 0; i < (count + kPad - 1) / kPad * kPad; ++i) {
      const Asked& at = asked[first + std::min(i, count - 1)];
      const double t = cells_[at.cell].at;
      points.instance[i] = cells_[at.cell].instance;
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
