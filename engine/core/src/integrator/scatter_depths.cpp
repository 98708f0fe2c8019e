#include "integrator/scatter_depths.h"

#include <algorithm>

#include "integrator/batch.h"
#include "math/math.h"

namespace glint {
namespace {

constexpr int kDepths = 36;
constexpr double kLeast = 0x1p-20;  // of the longest way to a ray's ends: it is not taken to pass
                                    // lights nearer than that

/// Optical depths, of the channel that is dimmed most, that bound the rungs.
struct Depths {
  double at[kDepths];
  Depths() {
    double depth = 0.1;
    for (double& d : at) {
      d = depth;
      depth *= 1.5;
    }
  }
};
const Depths kBounds;

double largest(Vec3d a) { return std::max({a.x, a.y, a.z}); }

/// sigma times a way, 0 where nothing dims.
double depth_of(double sigma, double way) { return sigma > 0 ? sigma * way : 0; }

}  // namespace

void ScatterDepths::build(const MediaSpans& spans, const Rays& rays, const double* ends) {
  rungs_.clear();
  first_.assign(1, 0);
  for (size_t k = 0; k < rays.count; ++k) {
    const Vec3d o{rays.o[0][k], rays.o[1][k], rays.o[2][k]};
    if (spans.scatters(k, rays.t_min[k], ends[k], max_abs(o))) {
      spans.list_pieces(k, rays.t_min[k], spans.reach(k, rays.t_min[k], ends[k]), pieces_);
      add_rungs(pieces_);
    }
    first_.push_back(uint32_t(rungs_.size()));
  }
}

/// Of one ray.
void ScatterDepths::add_rungs(const std::vector<MediaSpans::Piece>& pieces) {
  Vec3d before;
  double depth = 0;
  int next = 0;
  for (const MediaSpans::Piece& piece : pieces) {
    const double most = largest(piece.extinction), way = piece.to - piece.from,
                 end = depth + depth_of(most, way);
    double from = piece.from;
    while (next < kDepths && !(kBounds.at[next] > depth)) ++next;
    for (; next < kDepths && kBounds.at[next] < end; ++next) {
      const double to = std::min(piece.from + (kBounds.at[next] - depth) / most, piece.to);
      add_rung(piece, from, to, before);
      from = to;
    }
    add_rung(piece, from, piece.to, before);
    for (int c = 0; c < 3; ++c) before[c] += depth_of(piece.extinction[c], way);
    depth = end;
  }
}

/// before: the optical depth where the piece begins.
void ScatterDepths::add_rung(const MediaSpans::Piece& piece, double from, double to, Vec3d before) {
  if (!(from < to)) return;
  const auto density = [&](double t) {
    double sum = 0;
    for (int c = 0; c < 3; ++c)
      if (piece.scattering[c] != 0)
        sum += piece.scattering[c] *
               left_of(c, before[c] + depth_of(piece.extinction[c], t - piece.from));
    return sum;
  };
  const double first = density(from), last = density(to);
  rungs_.push_back({from, to, first, last});
}

/// What is left behind an optical depth, which is often that of the rung before or the channel
/// before.
double ScatterDepths::left_of(int channel, double depth) {
  if (depth == depth_[channel]) return left_[channel];
  const int before = channel > 0 ? channel - 1 : 0;
  left_[channel] = depth == depth_[before] ? left_[before] : exponential(-depth);
  depth_[channel] = depth;
  return left_[channel];
}

void ScatterDepths::aim(const Light* light, const LightPlace& place, const Rays& rays) {
  endless_ = place.endless;
  aimed_.resize(rungs_.size());
  nearest_.resize(rays.count);
  for (size_t k = 0; k < rays.count; ++k) {
    if (!any(k)) continue;
    const Vec3d o = row(rays.o, k), d = row(rays.d, k);
    aim_at(k, light ? light->lit_part(o, d) : Light::Part{-kInfinity, kInfinity}, place, o, d);
  }
}

void ScatterDepths::aim_at(size_t k, const Light::Part& lit, const LightPlace& place, Vec3d o,
                           Vec3d d) {
  const auto clipped = [&](double t) {
    return std::min(std::max(t, lit.from), std::max(lit.to, lit.from));
  };
  const uint32_t first = first_[k], end = first_[k + 1];
  double t = 0, D = 0;
  if (!place.endless) {
    const Vec3d to = place.center - o;
    t = dot(to, d);
    D = length(to - t * d);
    const double from = clipped(rungs_[first].from) - t, last = clipped(rungs_[end - 1].to) - t;
    D = std::max({D, kLeast * std::max(std::fabs(from), std::fabs(last)), place.nearness});
  }
  nearest_[k] = {t, D};
  double total = 0, last_at = -kInfinity, last_to = 0;
  for (uint32_t i = first; i < end; ++i) {
    const Rung& rung = rungs_[i];
    Aimed a{};
    a.from = clipped(rung.from);
    a.to = clipped(rung.to);
    const auto put = [&](double at, double& to, double& weight) {
      if (at != last_at) {  // where the rung before ends, most often
        const double s = at - t;
        last_at = at;
        last_to = endless_ ? at : s / (D + std::sqrt(D * D + s * s));
      }
      to = last_to;
      // at its ends, most often, without a division
      const double along = at == rung.from ? 0
                           : at == rung.to ? 1
                                           : (at - rung.from) / (rung.to - rung.from),
                   density = rung.first + (rung.last - rung.first) * along;
      weight = endless_ ? density : density * 2 / (1 + to * to);
    };
    if (a.from < a.to) {
      put(a.from, a.first, a.low);
      put(a.to, a.last, a.high);
      const double weight = 0.5 * (a.low + a.high) * (a.last - a.first);
      total += weight > 0 ? weight : 0;
    }
    a.total = total;
    aimed_[i] = a;
  }
}

ScatterDepths::Place ScatterDepths::at(size_t k, double share) const {
  const Aimed* const first = aimed_.data() + first_[k];
  const Aimed* const end = aimed_.data() + first_[k + 1];
  if (first == end) return {0, 0};
  const double whole = end[-1].total, x = share * whole;
  if (!(whole > 0 && whole < kInfinity)) return {0, 0};
  const Aimed* a = std::partition_point(first, end, [&](const Aimed& r) { return r.total <= x; });
  if (a == end) --a;
  const double own = a->total - (a == first ? 0 : a[-1].total);
  if (!(own > 0)) return {0, 0};
  // As many below as a density that goes straight from one to the other has.
  const double part = std::clamp(1 - (a->total - x) / own, 0.0, 1.0), low = a->low, high = a->high,
               inside = part * (low + high) /
                        (low + std::sqrt(low * low + part * (high - low) * (high + low))),
               v = a->first + inside * (a->last - a->first),
               spread = whole / (low + inside * (high - low));
  if (!(spread < kInfinity)) return {0, 0};
  if (endless_) return {v, spread};
  const double rest = (1 - v) * (1 + v), D = nearest_[k].D;
  return {std::clamp(nearest_[k].t + 2 * v * D / rest, a->from, a->to),
          spread * 2 * D * (1 + v * v) / (rest * rest)};
}

}  // namespace glint
