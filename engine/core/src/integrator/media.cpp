#include "integrator/media.h"

#include <algorithm>
#include <cmath>

#include "math/math.h"
#include "scene/surface.h"
#include "system/timer.h"

namespace glint {
namespace {

constexpr double kSlight = 0x1p-20;  // of a medium's distance: what is thinner scatters nothing
constexpr double kDark = 40;         // optical depth beyond which an endless ray has no points

/// sigma times a length that may be endless.
Vec3d times(Vec3d sigma, double way) {
  const auto channel = [&](double s) { return s > 0 ? s * way : 0; };
  return {channel(sigma.x), channel(sigma.y), channel(sigma.z)};
}

}  // namespace

MediaSpans::MediaSpans(const Scene& scene, Scratch& scratch)
    : scene_(scene),
      stages_(best_stages()),
      scratch_(scratch),
      opacities_(scene.media.enclosures.size(), Opacity::kVaried) {
  opacity_.of_instance = opacities_.data();
  if (opacities_.empty()) return;
  hits_.resize(kAtOnce * Layers::kMost);
  coinciding_.resize(Layers::kMost);
  taken_.resize(opacities_.size());
}

void MediaSpans::find(const Rays& rays, RayCounts& counts) {
  crossings_.clear();
  spans_.clear();
  end_.assign(rays.count, 0);
  if (scene_.media.enclosures.empty()) return;
  find_crossings(rays, counts);
  std::sort(crossings_.begin(), crossings_.end(), [](const Crossing& a, const Crossing& b) {
    return a.ray != b.ray               ? a.ray < b.ray
           : a.enclosure != b.enclosure ? a.enclosure < b.enclosure
                                        : a.t < b.t;
  });
  size_t ray = 0;
  for (size_t first = 0, next; first < crossings_.size(); first = next) {
    const Crossing& c = crossings_[first];
    for (; ray < c.ray; ++ray) end_[ray] = uint32_t(spans_.size());
    size_t end = first;
    next = merge(first, end);
    add_spans(rays, first, end);
  }
  for (; ray < rays.count; ++ray) end_[ray] = uint32_t(spans_.size());
}

/// Round by round, as many layers of each ray as are found at a time. Rays that have to go on wait
/// in place of earlier ones.
void MediaSpans::find_crossings(const Rays& rays, RayCounts& counts) {
  const Timer timer(counts.tracing);
  waiting_.begin(rays.count);
  for (uint32_t k = 0; k < rays.count; ++k)
    waiting_.add(k, rays.o, rays.d, k, rays.t_min[k], kInfinity);
  uint8_t found[kAtOnce], blocked[kAtOnce];
  uint32_t number[kAtOnce];
  waiting_.trace(number, rays.visibility, &opacity_, [&](const Rays& here) {
    scene_.trees.media().find_layers(here, {hits_.data(), found}, blocked, scratch_);
    for (size_t i = 0; i < here.count; ++i) {
      if (blocked[i] == 0) continue;
      const size_t layers = std::min<size_t>(found[i], Layers::kMost);
      take_layers(rays, number[i], hits_.data() + i * Layers::kMost, layers,
                  found[i] > Layers::kMost);
    }
  });
}

/// more: there are others beyond them, of which those that are as far as the last of these may be
/// missing.
void MediaSpans::take_layers(const Rays& rays, uint32_t ray, const Hit* hits, size_t count,
                             bool more) {
  size_t taken = count;
  while (more && taken > 0 && beyond(hits[taken - 1].t) >= hits[count - 1].t) --taken;
  double last = hits[count - 1].t;
  if (more && taken == 0) {
    take_coinciding(rays, ray, hits[0].t, last);
  } else {
    take(rays, ray, hits, taken);
    last = beyond(hits[taken - 1].t);
  }
  if (more) waiting_.add(ray, rays.o, rays.d, ray, last, kInfinity);
}

/// Of the distances [from, to], at which there are more layers than are found at a time: enclosure
/// after enclosure, all of each at once but for those with as many layers there.
void MediaSpans::take_coinciding(const Rays& rays, uint32_t ray, double from, double to) {
  const double before = std::nextafter(from, -kInfinity), after = std::nextafter(to, kInfinity);
  const Rays one{{rays.o[0] + ray, rays.o[1] + ray, rays.o[2] + ray},
                 {rays.d[0] + ray, rays.d[1] + ray, rays.d[2] + ray},
                 &before,
                 &after,
                 1,
                 rays.visibility,
                 &opacity_};
  std::fill(taken_.begin(), taken_.end(), uint8_t(0));
  for (bool more = true; more;) {
    uint8_t found = 0, blocked = 0;
    Layers layers{coinciding_.data(), &found};
    layers.left_out = taken_.data();
    scene_.trees.media().find_layers(one, layers, &blocked, scratch_);
    more = found > Layers::kMost;
    size_t count = more ? Layers::kMost : found;
    if (more) {  // of the last enclosure some may be missing
      std::sort(coinciding_.begin(), coinciding_.end(),
                [](const Hit& a, const Hit& b) { return a.instance < b.instance; });
      const uint32_t last = coinciding_.back().instance;
      if (coinciding_.front().instance != last)
        while (coinciding_[count - 1].instance == last) --count;
    }
    for (size_t i = 0; i < count; ++i) taken_[coinciding_[i].instance] = 1;
    take(rays, ray, coinciding_.data(), count);
  }
}

void MediaSpans::take(const Rays& rays, uint32_t ray, const Hit* hits, size_t count) {
  for (size_t i = 0; i < count; ++i)
    crossings_.push_back({ray, hits[i].instance, hits[i].t, enters(rays, ray, hits[i]) ? 1 : -1});
}

/// Whether the ray meets the outer side.
bool MediaSpans::enters(const Rays& rays, uint32_t ray, const Hit& hit) const {
  const Vec3d d{rays.d[0][ray], rays.d[1][ray], rays.d[2][ray]};
  const uint32_t instance = scene_.media.enclosures[hit.instance].instance;
  const GlintGeometry& geometry = scene_.instances.geometry(scene_.instances.group(instance));
  if (geometry.kind != GLINT_MESH) {
    Hit met = hit;
    met.instance = instance;
    return surface_at(scene_, {rays.o[0][ray], rays.o[1][ray], rays.o[2][ray]}, d, met).outside;
  }
  const uint32_t* corner = geometry.triangles + 3 * size_t(hit.primitive);
  const Vec3d a = vertex(geometry, corner[0]), b = vertex(geometry, corner[1]),
              c = vertex(geometry, corner[2]);
  return dot(scene_.instances.normal_matrix(instance)(unit(cross(b - a, c - a))), d) <= 0;
}

/// Makes the crossings of one ray and enclosure that rounding cannot tell apart one; they are
/// [first, end) then. Where the next ones begin.
size_t MediaSpans::merge(size_t first, size_t& end) {
  size_t next = first;
  end = first;
  const Crossing group = crossings_[first];
  const auto same = [&](const Crossing& c) {
    return c.ray == group.ray && c.enclosure == group.enclosure;
  };
  while (next < crossings_.size() && same(crossings_[next])) {
    Crossing one = crossings_[next];
    bool in = one.step > 0, out = one.step < 0;
    double last = one.t;
    for (++next;
         next < crossings_.size() && same(crossings_[next]) && crossings_[next].t <= beyond(last);
         ++next) {
      in |= crossings_[next].step > 0;
      out |= crossings_[next].step < 0;
      last = crossings_[next].t;
    }
    one.step = int(in) - int(out);
    crossings_[end++] = one;
  }
  return next;
}

/// Of one ray and enclosure: where the ray goes out further on more often than in, so that it does
/// not matter from where it looks.
void MediaSpans::add_spans(const Rays& rays, size_t first, size_t end) {
  int depth = 0;
  for (size_t i = end; i-- > first;) {
    const Crossing& c = crossings_[i];
    depth = std::max(0, depth - c.step);
    if (depth > 0)
      add_span(rays, c.ray, c.enclosure, i > first ? crossings_[i - 1].t : -kInfinity, c.t);
  }
}

/// Cut to the enclosure's box: a surface that is not closed bounds nothing beyond it.
void MediaSpans::add_span(const Rays& rays, uint32_t ray, uint32_t enclosure, double from,
                          double to) {
  const Enclosure& e = scene_.media.enclosures[enclosure];
  for (int c = 0; c < 3; ++c) {
    const double o = rays.o[c][ray], d = rays.d[c][ray];
    if (d == 0) {
      if (o < e.low[c] || o > e.high[c]) return;
      continue;
    }
    const double a = (e.low[c] - o) / d, b = (e.high[c] - o) / d;
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  }
  if (from < to) spans_.push_back({enclosure, from, to});
}

MediaSpans::Span MediaSpans::everywhere(size_t k) const {
  if (world()->program) return everywhere_[k];
  return {0, -kInfinity, kInfinity};
}

/// The optical depth of a span between two places.
Vec3d MediaSpans::depth_of(const Medium& medium, const Span& span, double from, double to) const {
  if (!medium.program) {
    const double way = std::min(span.to, to) - std::max(span.from, from);
    return way > 0 ? times(medium.extinction, way) : Vec3d{};
  }
  Vec3d sum;
  const Cell* cell = cells_.data() + span.first_cell;
  if (summed_ && span.cells > 0 && from <= cell->from) {
    const Cell* const first = cell;
    cell =
        std::partition_point(first, first + span.cells, [&](const Cell& c) { return c.from < to; });
    if (cell == first) return sum;
    --cell;
    const double way = std::min(cell->to, to) - cell->from;
    return way > 0 ? cell->before + times(cell->matter.extinction, way) : cell->before;
  }
  for (const Cell* const end = cell + span.cells; cell != end && cell->from < to; ++cell) {
    const double way = std::min(cell->to, to) - std::max(cell->from, from);
    if (way > 0) sum += times(cell->matter.extinction, way);
  }
  return sum;
}

void MediaSpans::sum_depths() {
  const auto sum = [&](const Span& span) {
    Vec3d before;
    for (size_t i = span.first_cell; i < size_t(span.first_cell) + span.cells; ++i) {
      Cell& cell = cells_[i];
      cell.before = before;
      before += times(cell.matter.extinction, cell.to - cell.from);
    }
  };
  std::for_each(spans_.begin(), spans_.end(), sum);
  std::for_each(everywhere_.begin(), everywhere_.end(), sum);
  summed_ = true;
}

/// What there is at a place in a span; null where that is not known.
const Matter* MediaSpans::matter_at(const Medium& medium, const Span& span, double t) const {
  if (!medium.program) return &medium;
  const Cell* const first = cells_.data() + span.first_cell;
  const Cell* const end = first + span.cells;
  const Cell* cell = std::partition_point(first, end, [&](const Cell& c) { return c.to < t; });
  return cell != end && cell->from <= t ? &cell->matter : nullptr;
}

Vec3d MediaSpans::depth(size_t k, double from, double to, uint64_t passed_sets,
                        bool catchers_alone) const {
  Vec3d sum;
  if (!(from < to)) return sum;
  if (world()) sum = depth_of(*world(), everywhere(k), from, to);
  for (size_t i = first_span(k); i < end_[k]; ++i) {
    const Span& span = spans_[i];
    const GlintInstances& group =
        scene_.instances.group(scene_.media.enclosures[span.enclosure].instance);
    if (passed_sets && passed_sets >> group.light_set & 1) continue;
    if (catchers_alone && !(group.flags & GLINT_CATCHER)) continue;
    sum += depth_of(medium_of(span), span, from, to);
  }
  return sum;
}

Vec3d MediaSpans::passed(size_t k, double from, double to, uint64_t passed_sets,
                         bool catchers_alone) const {
  if (first_span(k) == end_[k] && !world()) return {1, 1, 1};
  const Vec3d tau = depth(k, from, to, passed_sets, catchers_alone);
  Vec3d left{exponential(-tau.x), 0, 0};
  left.y = tau.y == tau.x ? left.x : exponential(-tau.y);
  left.z = tau.z == tau.y ? left.y : exponential(-tau.z);
  return left;
}

/// Where a span of a ray begins and ends, and its cells do, between two places.
void MediaSpans::add_breaks(const Medium& medium, const Span& span, double from, double to) const {
  const auto add = [&](double t) {
    if (t > from && t < to) breaks_.push_back(t);
  };
  add(span.from);
  add(span.to);
  if (!medium.program) return;
  for (size_t i = span.first_cell; i < size_t(span.first_cell) + span.cells; ++i) add(cells_[i].to);
}

void MediaSpans::list_pieces(size_t k, double from, double to, std::vector<Piece>& pieces,
                             const int* emits) const {
  pieces.clear();
  if (!(from < to)) return;
  breaks_.assign({from, to});
  const size_t first = first_span(k);
  if (world()) add_breaks(*world(), everywhere(k), from, to);
  for (size_t i = first; i < end_[k]; ++i) add_breaks(medium_of(spans_[i]), spans_[i], from, to);
  std::sort(breaks_.begin(), breaks_.end());
  for (size_t b = 0; b + 1 < breaks_.size(); ++b) {
    Piece piece{breaks_[b], breaks_[b + 1], {}, {}, {}};
    if (!(piece.from < piece.to)) continue;
    const double inside = piece.to < kInfinity ? 0.5 * (piece.from + piece.to) : piece.from + 1;
    const auto add = [&](const Matter* matter, int group) {
      if (!matter) return;
      piece.extinction += matter->extinction;
      piece.scattering += matter->scattering;
      if (!emits || *emits == group) piece.emission += matter->emission;
    };
    if (world()) add(matter_at(*world(), everywhere(k), inside), scene_.world.light_group);
    for (size_t i = first; i < end_[k]; ++i) {
      const Enclosure& e = scene_.media.enclosures[spans_[i].enclosure];
      if (inside > spans_[i].from && inside < spans_[i].to)
        add(matter_at(scene_.media[e.medium], spans_[i], inside),
            scene_.instances.group(e.instance).light_group - 1);
    }
    pieces.push_back(piece);
  }
}

bool MediaSpans::scatters(size_t k, double from, double to, double origin) const {
  const auto wide = [&](double first, double last) {
    return last - first > (last < kInfinity ? kSlight * (last + origin) : 0);
  };
  bool some = world() && world()->scatters() && wide(from, to);
  for (size_t i = first_span(k); i < end_[k] && !some; ++i)
    some = medium_of(spans_[i]).scatters() &&
           wide(std::max(spans_[i].from, from), std::min(spans_[i].to, to));
  return some;
}

double MediaSpans::reach(size_t k, double from, double to) const {
  if (to < kInfinity) return to;
  double last = from;
  for (size_t i = first_span(k); i < end_[k]; ++i) last = std::max(last, spans_[i].to);
  if (!world()) return last;
  if (world()->program) {  // the last of its cells is endless
    const Span& span = everywhere_[k];
    return span.cells > 0 ? std::max(last, cells_[span.first_cell + span.cells - 1].from) : last;
  }
  double least = kInfinity;
  for (int c = 0; c < 3; ++c)
    if (world()->scattering[c] > 0) least = std::min(least, world()->extinction[c]);
  return last + kDark / least;
}

Vec3d MediaSpans::scattering(size_t k, double t, Vec3d d, Vec3d l, uint64_t excluded_sets) const {
  Vec3d sum;
  const double cosine = dot(d, l);
  const auto add = [&](const Matter* matter) {
    if (!matter) return;
    const double g = matter->anisotropy, base = 1 + g * g - 2 * g * cosine;
    sum += (1 - g * g) / (4 * kPi * base * std::sqrt(base)) * matter->scattering;
  };
  if (world()) add(matter_at(*world(), everywhere(k), t));
  for (size_t i = first_span(k); i < end_[k]; ++i) {
    const Span& span = spans_[i];
    const Enclosure& e = scene_.media.enclosures[span.enclosure];
    const bool lit = !(excluded_sets >> scene_.instances.group(e.instance).light_set & 1);
    if (lit && span.from <= t && t <= span.to) add(matter_at(scene_.media[e.medium], span, t));
  }
  return sum;
}

}  // namespace glint
