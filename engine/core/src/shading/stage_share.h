// What many lamps give to points, and which of them each point asks for shadows
// (semantics/many_lamps.md).
#pragma once
#include "shading/stage_cluster.h"

namespace glint {
namespace {

/// What something gives to points: three rows for the channels, so far apart.
struct Given {
  double* rows;
  size_t length;
};

/// Adds what one sample gives to the points [first, end), and tells it alone in `given`.
template <class Shape, bool Bent, bool IsDrawn>
__attribute__((flatten)) void add_sample(const ShareStage& to, const LampSample& lamp, size_t first,
                                         size_t end, Given given) {
  for (size_t k = first; k < end; k += kLanes, given.rows += kLanes) {
    Three both{};
    contribute<Shape, Bent, IsDrawn>(
        *to.points, lamp, k,
        [&](const SeenSample&, Mask reached, const Three& diffuse, const Three& specular) {
          const Three matt = where(reached, diffuse), shiny = where(reached, specular);
          both = matt + shiny;
          store(to.total + k,
                load(to.total + k) + (magnitude(both.x) + magnitude(both.y) + magnitude(both.z)));
          if (!IsDrawn) store3(to.diffuse, k, load3(to.diffuse, k) + matt);
          store3(to.specular, k, load3(to.specular, k) + shiny);
        });
    store(given.rows, both.x);
    store(given.rows + given.length, both.y);
    store(given.rows + 2 * given.length, both.z);
  }
}

template <bool Bent>
void add_lamp_as(const ShareStage& to, const LampSample& lamp, size_t first, size_t end,
                 Given given) {
  const LightShape shape = lamp.light.shape;
  const auto add = [&]<class Shape>() {
    add_sample<Shape, Bent, false>(to, lamp, first, end, given);
  };
  const auto add_drawn = [&]<class Shape>() {
    add_sample<Shape, Bent, true>(to, lamp, first, end, given);
  };
  if (lamp.drawn) with_shape(kDrawnLamps, shape, add_drawn);
  else with_shape(kSharing, shape, add);
}

void add_lamp(const ShareStage& to, const LampSample& lamp, size_t first, size_t end, Given given) {
  if (is_bent(*to.points)) add_lamp_as<true>(to, lamp, first, end, given);
  else add_lamp_as<false>(to, lamp, first, end, given);
}

/// Round the lit points of a block: a ball, and a cone of their normals.
struct BlockBounds {
  double center[3] = {}, radius = 0, normal[3] = {}, cosine = 1, sine = 0;
};

inline double dot3(const double* a, const double* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// False where no point is lit.
bool bound_block(const ShareStage& s, size_t first, size_t end, BlockBounds& b) {
  double low[3], high[3];
  bool some = false;
  for (size_t k = first; k < end; ++k) {
    if (!s.lit[k]) continue;
    for (size_t c = 0; c < 3; ++c) {
      const double x = s.points->x[c][k];
      low[c] = some && low[c] < x ? low[c] : x;
      high[c] = some && high[c] > x ? high[c] : x;
      b.normal[c] += s.points->n[c][k];
    }
    some = true;
  }
  if (!some) return false;
  double half[3];
  for (size_t c = 0; c < 3; ++c) {
    b.center[c] = 0.5 * (low[c] + high[c]);
    half[c] =
        high[c] - b.center[c] > b.center[c] - low[c] ? high[c] - b.center[c] : b.center[c] - low[c];
  }
  b.radius = __builtin_sqrt(dot3(half, half));
  const double length = __builtin_sqrt(dot3(b.normal, b.normal));
  for (double& x : b.normal) x = length > 0 ? x / length : 0;
  // light passes through fibres from behind, and lobes may have other normals
  const LobeColumns& lobes = s.points->lobes;
  b.cosine = length > 0 && !lobes.has_fibre && !lobes.turns ? 1 : -1;
  for (size_t k = first; k < end; ++k) {
    const double n[3] = {s.points->n[0][k], s.points->n[1][k], s.points->n[2][k]},
                 cosine = dot3(n, b.normal);
    if (s.lit[k] && cosine < b.cosine) b.cosine = cosine;
  }
  b.cosine -= 1e-9;
  b.sine = __builtin_sqrt(b.cosine > -1 ? 1 - b.cosine * b.cosine + 1e-9 : 0);
  return true;
}

/// How far from the light's centre its samples lie.
inline double radius_of(const LightSample& s) {
  const bool round = s.shape == LightShape::kSphere || s.shape == LightShape::kDisc;
  return round ? s.round.radius : s.shape == LightShape::kRectangle ? s.area.rectangle.size : 0;
}

/// Whether the points may be within the cone of a spot whose middle is at -`to` of theirs.
inline bool may_be_in_cone(const LightSample& s, const BlockBounds& b, const double* to) {
  const double along = -dot3(to, s.axis), across2 = dot3(to, to) - along * along,
               across = __builtin_sqrt(across2 > 0 ? across2 : 0), cosine = s.spot.cosine,
               sine = __builtin_sqrt(cosine < 1 ? 1 - cosine * cosine : 0);
  // beside the cone's surface, or behind its tip where it is no wider than a half space
  return cosine < 0 || cosine * across - sine * along <=
                           b.radius + radius_of(s) + 1e-9 * (across + __builtin_fabs(along));
}

/// Whether the normals may be turned to something that is no farther than `reach` from the place
/// `to` of the points' middle.
inline bool may_be_above(const BlockBounds& b, const double* to, double reach) {
  if (b.cosine <= 0) return true;
  const double up = dot3(to, b.normal), length2 = dot3(to, to), beside2 = length2 - up * up,
               beside = __builtin_sqrt(beside2 > 0 ? beside2 : 0);
  // the largest product with a normal of the cone
  return up * b.cosine + beside * b.sine + reach + 1e-9 * __builtin_sqrt(length2) > 0 ||
         up > b.cosine * __builtin_sqrt(length2);
}

/// False where it is certain that the sample gives nothing to any point of the block.
bool may_reach(const LampSample& lamp, const BlockBounds& b) {
  const LightSample& s = lamp.light;
  if (s.shape == LightShape::kSun) return lamp.drawn || may_be_above(b, s.sun.l, 0);
  const bool is_plane = s.shape == LightShape::kArea,
             is_flat = is_plane || s.shape == LightShape::kRectangle;
  double to[3];
  for (size_t c = 0; c < 3; ++c) to[c] = s.center[c] - b.center[c];
  const double slack = 1e-9 * __builtin_sqrt(dot3(to, to));
  if (is_flat && -dot3(to, s.axis) + b.radius + slack < 0) return false;
  if (s.spot.on && !may_be_in_cone(s, b, to)) return false;
  if (is_plane) {
    if (lamp.drawn) return true;
    for (size_t c = 0; c < 3; ++c) to[c] = s.area.end[c] - b.center[c];
  }
  return may_be_above(b, to, b.radius + radius_of(s));
}

/// What the middle of a cluster gives to a point by n l / d^2 for a colour of 1; where the horizon
/// cuts its ball as if the lamps were spread evenly from its lowest point to its highest.
double middle_light(const ShareStage& s, const LampCluster& c, uint32_t point) {
  double to[3], n[3];
  for (size_t i = 0; i < 3; ++i) {
    to[i] = c.center[i] - s.points->x[i][point];
    n[i] = s.points->n[i][point];
  }
  const double d2 = dot3(to, to), up = dot3(n, to), reach = __builtin_sqrt(c.radius2),
               over = up + reach, height = up * up < c.radius2 ? over * over / (4 * reach) : up;
  return height / __builtin_sqrt(d2) * s.samples[c.first].light.scale2 /
         ((4 * kCircle * kCircle) * d2);
}

/// Which lamps' samples of a cluster the rays [from, to) of a point fall to. at: where the cluster
/// begins in the row; scale: that of light; light: the cluster's.
size_t choose_within(const ShareStage& s, const LampCluster& c, uint32_t point, double at,
                     double scale, uint32_t from, uint32_t to, const double* light,
                     ShadowRequest* chosen) {
  double each[3], large[3];  // light a colour, and how long it is in the row
  for (size_t i = 0; i < 3; ++i) {
    each[i] = c.color[i] > 0 ? light[i] / c.color[i] : 0;
    large[i] = scale * __builtin_fabs(each[i]);
  }
  const double middle = middle_light(s, c, point);
  at = s.offset - at + dot3(large, s.color_sums + 3 * c.first);  // of ray 0, as the sums count
  size_t found = 0;
  for (uint32_t sample = c.first; from < to; ++sample) {
    for (uint32_t beyond = c.last; sample < beyond;) {  // the first that ends beyond ray `from`
      const uint32_t half = sample + (beyond - sample) / 2;
      if (dot3(large, s.color_sums + 3 * (half + 1)) > at + from) beyond = half;
      else sample = half + 1;
    }
    const double *before = s.color_sums + 3 * sample, *after = before + 3;
    const double limit = dot3(large, after) - at;
    uint32_t end = from + 1;
    while (end < to && (sample == c.last || end < limit)) ++end;
    const double color[3] = {after[0] - before[0], after[1] - before[1], after[2] - before[2]},
                 length = dot3(large, color),
                 times = length > 0 ? scale * (end - from) / length : 0;
    chosen[found++] = {
        sample,
        point,
        {times * each[0] * color[0], times * each[1] * color[1], times * each[2] * color[2]},
        middle};
    from = end;
  }
  return found;
}

/// Samples and clusters that reach points: their numbers, and what they give.
struct Reached {
  uint32_t* numbers;
  double* rows;
  size_t length, count = 0;
  Given give(size_t number) {
    numbers[count] = uint32_t(number);
    return {rows + 3 * length * count++, length};
  }
  const double* given(size_t i) const { return rows + 3 * length * i; }
};

/// The row of light of kLanes points: how long a unit of light is in it, and how much of the row,
/// and how many rays, lie before what comes next.
struct LightRow {
  Doubles scale, sum, before;
  size_t found;
};

/// Those of the rays of the points at k that lie in what reaches them, in the order of the row.
/// first: where the points are in the rows of `reached`.
void choose_samples(const ShareStage& s, size_t k, const Reached& reached, size_t first,
                    LightRow& row, ShadowRequest* chosen) {
  const Doubles rays = splat(double(s.rays));
  for (size_t i = 0; i < reached.count; ++i) {
    const double* const given = reached.given(i) + first;
    const Three light = {load(given), load(given + reached.length),
                         load(given + 2 * reached.length)};
    const Doubles all = magnitude(light.x) + magnitude(light.y) + magnitude(light.z);
    row.sum = row.sum + all;
    const Doubles here = smaller(larger(-down(s.offset - row.sum * row.scale), splat(0)), rays);
    const Doubles times = here - row.before, start = row.before;
    row.before = larger(here, row.before);
    uint32_t lanes = bits(times > 0);
    if (!lanes) continue;
    if (reached.numbers[i] >= s.sample_count) {
      const LampCluster& c = s.clusters[reached.numbers[i] - s.sample_count];
      for (; lanes; lanes &= lanes - 1) {
        const uint32_t lane = uint32_t(__builtin_ctz(lanes));
        const double own[3] = {light.x[lane], light.y[lane], light.z[lane]};
        const double from = start[lane];
        row.found += choose_within(
            s, c, uint32_t(k) + lane, (row.sum[lane] - all[lane]) * row.scale[lane],
            row.scale[lane], uint32_t(from), uint32_t(from + times[lane]), own, chosen + row.found);
      }
      continue;
    }
    const Three share = (times / all) * light;
    for (; lanes; lanes &= lanes - 1) {
      const uint32_t lane = uint32_t(__builtin_ctz(lanes));
      chosen[row.found++] = {
          reached.numbers[i], uint32_t(k) + lane, {share.x[lane], share.y[lane], share.z[lane]}, 0};
    }
  }
}

/// Clusters that the points at k see as one, and lamps that some of them do not.
void add_clusters(const ShareStage& s, const BlockBounds& bounds, size_t k, Reached& reached) {
  ClusterWalk walk = begin_walk(s, k);
  for (size_t at = 0; at < s.cluster_count;) {
    const LampCluster& c = s.clusters[at];
    look(s, at, k, walk);
    if (any(walk.far)) {
      double* const given = reached.give(s.sample_count + at).rows;
      if (is_bent(*s.points)) add_cluster<true>(s, c, walk.far, k, given);
      else add_cluster<false>(s, c, walk.far, k, given);
    }
    const bool near = any(walk.near), is_lamp = c.next == at + 1;
    if (near && is_lamp) {
      store(s.near + k, walk.near);
      for (size_t i = c.first; i < c.end; ++i)
        if (may_reach(s.samples[i], bounds))
          add_lamp(s, s.samples[i], k, k + kLanes, reached.give(i));
    }
    at = near ? at + 1 : c.next;
  }
}

/// Adds what was given to the points [first, end) to the groups of lights. Clusters are of one
/// each.
void add_to_groups(const ShareStage& s, const Reached& reached, size_t first, size_t end) {
  for (size_t i = 0; i < reached.count; ++i) {
    const double* const given = reached.given(i);
    const uint32_t number = reached.numbers[i];
    const uint32_t sample =
        number < s.sample_count ? number : s.clusters[number - s.sample_count].first;
    for (size_t c = 0; c < 3; ++c) {
      double* const sums = s.group_total[3 * size_t(s.groups[sample]) + c];
      for (size_t k = first; k < end; k += kLanes)
        store(sums + k, load(sums + k) + load(given + c * reached.length + (k - first)));
    }
  }
}

/// What gloss gives back of the samples' light at the points [first, end).
void find_gloss(const ShareStage& to, size_t first, size_t end) {
  if (!to.gloss[0] || to.sample_count == 0) return;
  for (size_t k = first; k < end; k += kLanes) store3(to.gloss, k, even_gloss(*to.points, k));
}

/// Those of a block all see the samples that are not in clusters. From there on each kLanes points
/// go their own way: what others see as one is not near them.
size_t share_block(const ShareStage& s, size_t first, size_t end, ShadowRequest* chosen) {
  BlockBounds bounds;
  if (!bound_block(s, first, end, bounds)) return 0;
  find_gloss(s, first, end);
  Reached reached{s.reaching, s.contributions, kShareBlock};
  for (size_t i = 0; i < s.clustered; ++i)
    if (may_reach(s.samples[i], bounds)) add_lamp(s, s.samples[i], first, end, reached.give(i));
  if (s.groups) add_to_groups(s, reached, first, end);
  size_t found = 0;
  for (size_t k = first; k < end; k += kLanes) {
    const Mask lit = load(s.lit + k) & valid_lanes(k, s.points->count);
    if (!any(lit)) continue;
    Reached own{s.reaching + reached.count, s.contributions + 3 * kShareBlock * reached.count,
                kLanes};
    if (s.cluster_count > 0) add_clusters(s, bounds, k, own);
    if (s.groups) add_to_groups(s, own, k, k + kLanes);
    const Doubles total = load(s.total + k);
    LightRow row{where(lit & (total > 0), double(s.rays) / total), {}, {}, found};
    choose_samples(s, k, reached, k - first, row, chosen);
    choose_samples(s, k, own, 0, row, chosen);
    found = row.found;
  }
  return found;
}

size_t share(const ShareStage& s) {
  const size_t count = s.points->count;
  size_t found = 0;
  for (size_t first = 0; first < count; first += kShareBlock) {
    const size_t end = first + kShareBlock < count ? first + kShareBlock : count;
    for (size_t k = first; k < end; k += kLanes) {
      store(s.total + k, Doubles{});
      store3(s.diffuse, k, Three{});
      store3(s.specular, k, Three{});
    }
    found += share_block(s, first, end, s.chosen + found);
  }
  return found;
}

}  // namespace
}  // namespace glint
