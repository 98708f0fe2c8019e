#include "integrator/subsurface.h"

#include <algorithm>

#include "film/refine.h"
#include "math/math.h"

namespace glint {
namespace {

constexpr double kShares[3] = {1, 0.5, 0.5};  // rays of a sample along the axes of a point
constexpr double kLeast = 1.0 / 64;           // of a ring's light, that counts
constexpr int kMostSteps = 100;
constexpr double kExact = 0x1p-28;  // of the last step, whose error is its square

/// The share of a profile with 1 / (3 d) = third that is within r.
double within(double r, double third) {
  const double e = exponential(-r * third);
  return 1 - (e * e * e + 3 * e) / 4;
}

/// Two unit vectors across n, as programs have them (program/op_rays.h).
Vec3d first_across(Vec3d n) {
  const Vec3d t = cross(Vec3d{1, 2, 3}, n);
  return unit(any(t) ? t : cross(Vec3d{1, 0, 0}, n));
}

}  // namespace

Profile::Profile(Vec3d radius) : d(radius) {
  for (int c = 0; c < 3; ++c) reach = std::max(reach, kReach * d[c]);
  for (int c = 0; c < 3; ++c) {
    if (!(d[c] > 0)) continue;
    ++channels;
    third[c] = 1 / (3 * d[c]);
    whole[c] = within(reach, third[c]);
  }
}

double Profile::mean(double r) const {
  double sum = 0;
  for (int c = 0; c < 3; ++c)
    if (d[c] > 0) sum += within(r, third[c]) / whole[c];
  return sum / channels;
}

/// By Newton's steps; by halves where these lead out of what is known.
double Profile::radius(double share) const {
  if (share <= 0) return 0;
  if (share >= 1) return reach;
  double low = 0, high = reach, r = reach / 8;
  for (int step = 0; step < kMostSteps; ++step) {
    const double off = mean(r) - share;
    (off < 0 ? low : high) = r;
    double slope = 0;  // of the mean: times() over 4 but for what is common
    for (int c = 0; c < 3; ++c) {
      if (!(d[c] > 0)) continue;
      const double e = exponential(-r * third[c]);
      slope += 3 * third[c] * (e * e * e + e) / (4 * whole[c]);
    }
    const double to = r - off * channels / slope,
                 next = to > low && to < high ? to : (low + high) / 2;
    const double way = std::abs(next - r);
    r = next;
    if (!(way > kExact * r)) break;
  }
  return r;
}

Vec3d Profile::ring(double low, double high) const {
  const double all = mean(high) - mean(low);
  Vec3d share;
  for (int c = 0; c < 3; ++c)
    if (d[c] > 0) share[c] = (within(high, third[c]) - within(low, third[c])) / (whole[c] * all);
  return share;
}

Vec3d Profile::fall(double near, double far) const {
  Vec3d share;
  for (int c = 0; c < 3; ++c) {
    if (!(d[c] > 0)) continue;
    const double before = exponential(-2 * near * third[c]),
                 after = exponential(-2 * far * third[c]);
    share[c] = exponential((near - far) * third[c]) * (1 + after) / (1 + before);
  }
  return share;
}

Subsurface::Subsurface(const Scene& scene, const RenderPlan& plan)
    : scene_(scene), plan_(plan), on_(scene.materials.has_subsurface && plan.subsurface_points) {}

/// A twentieth of what a pixel in the middle of the picture spans so far away, in the world: what
/// is narrower is not seen.
double Subsurface::least_radius(Vec3d x) const {
  const ProgramView& view = *scene_.input_tables().view;
  if (view.parallel) return view.step / 2;
  Vec3d away;
  for (int c = 0; c < 3; ++c) away[c] = x[c] / view.scale + view.origin[c] - view.eye[c];
  return view.step / 2 * length(away);
}

const Subsurface::Ring& Subsurface::ring(Vec3d radius, const double* row) {
  Ring& ring = known_;
  if (ring.row == row && !any(ring.profile.d - radius)) return ring;
  ring.row = row;
  ring.profile = Profile(radius);
  ring.r = ring.profile.radius(row[1]);
  ring.share = ring.profile.ring(ring.profile.radius(row[0]), ring.profile.radius(row[2]));
  return ring;
}

void Subsurface::enter(Batch& batch, uint32_t k, const double* place) {
  const GlintInstances& group = scene_.instances.group(batch.instance[k]);
  if (scene_.instances.geometry(group).kind == GLINT_STRANDS) return;
  const Vec3d x = row(batch.x, k), below = row(batch.below, k);
  const double least = least_radius(x);
  Vec3d radius = row(batch.radius, k), given, left = row(batch.diffuse, k);
  for (int c = 0; c < 3; ++c) {
    const bool goes =
        below[c] != 0 && std::isfinite(below[c]) && radius[c] >= least && radius[c] > 0;
    given[c] = goes ? below[c] : 0;
    radius[c] = goes ? scene_.anchor.scale * radius[c] : 0;
    left[c] -= given[c];
  }
  if (!any(given)) return;
  set_row(batch.diffuse, k, left);
  const Vec3d g = row(batch.g, k), first = first_across(g), T = batch.queue->weight(k);
  Vec3d most;
  for (int c = 0; c < 3; ++c) most[c] = std::max(1.0, std::abs(T[c] / given[c]));
  const Ring& found = ring(radius, place);
  points_.push_back(
      {k, found, given * found.share, most, {g, first, cross(g, first)}, x, batch.outside[k] != 0});
}

void Subsurface::leave(const Batch& batch, SceneQueries& queries, Queue& exits, RayCounts& counts) {
  if (points_.empty()) return;
  exits_.clear();
  queries.probe(batch, counts);
  for (size_t first = 0; first < points_.size(); first += kBlock) {
    const size_t count = std::min(points_.size() - first, size_t(kBlock));
    for (const bool across : {false, true}) look(first, count, across, queries);
  }
  // those that look in one direction together, of each pixel in an order of its own
  std::stable_sort(exits_.begin(), exits_.end(),
                   [](const Exit& a, const Exit& b) { return a.order < b.order; });
  for (const Exit& exit : exits_) {
    Path path = batch.queue->path(points_[exit.point].row);
    path.T = exit.T;
    path.start = exit.ray.o;
    path.wants_data = false;
    exits.push(exit.ray, path, exit.hit);
  }
}

/// Where the rays of a sample of some points come out that go along their normals, or across these.
void Subsurface::look(size_t first, size_t count, bool across, SceneQueries& queries) {
  ProgramPoints points;
  AskedRays rays;
  const Batch& batch = queries.batch();
  for (size_t i = 0; i < count; ++i) {
    const Point& point = points_[first + i];
    points.instance[i] = batch.instance[point.row];
    points.row[i] = point.row;
    const double* const place = point.ring.row;
    const size_t axis = axis_of(point, across);
    const Vec3d &w = point.axes[axis], &u = point.axes[(axis + 1) % 3],
                &v = point.axes[(axis + 2) % 3];
    const double r = point.ring.r, reach = point.ring.profile.reach,
                 height = std::sqrt(std::max(reach * reach - r * r, 0.0));
    const Vec3d o = point.x + r * (place[3] * u + place[4] * v) + height * w;
    for (int c = 0; c < 3; ++c) {
      rays.o[c][i] = o[c];
      rays.d[c][i] = -w[c];
    }
    rays.t_max[i] = 2 * height;
  }
  const AskedHits hits = queries.find_crossings(points, count, rays);
  parts_.resize(hits.count);
  sums_.assign(count, {});
  for (size_t i = 0; i < hits.count; ++i) {
    const Point& point = points_[first + hits.point[i]];
    parts_[i] = share(point, axis_of(point, across), row(hits.x, i), row(hits.g, i));
    sums_[hits.point[i]] += parts_[i];
  }
  layer_.assign(count, 0);
  for (size_t i = 0; i < hits.count; ++i) {
    const uint32_t k = hits.point[i], layer = layer_[k]++, number = uint32_t(first) + k;
    const Point& point = points_[number];
    Vec3d T = point.given * parts_[i];
    for (int c = 0; c < 3; ++c)  // no more than went in
      if (sums_[k][c] > point.most[c]) T[c] *= point.most[c] / sums_[k][c];
    if (!any(T) || !finite(T) || max_abs(parts_[i]) < kLeast) continue;
    Vec3d o, d;
    for (int c = 0; c < 3; ++c) {
      o[c] = rays.o[c][k];
      d[c] = rays.d[c][k];
    }
    const Hit hit = queries.hit(i);
    if ((hits.outside[i] != 0) != point.outside) {  // seen from where the light came
      o = o + 2 * hit.t * d;
      d = -d;
    }
    const uint32_t order = across * Layers::kMost + layer;
    exits_.push_back({order, number, {o, d, 0, rays.t_max[k], kMirror}, hit, T});
  }
}

/// What of the light of a ring comes out where its ray along an axis meets a surface: each of the
/// three axes has the whole of it, and they weigh by how well they see the surface (the power
/// heuristic).
Vec3d Subsurface::share(const Point& point, size_t axis, Vec3d x, Vec3d g) {
  double dense[3], total = 0;
  for (size_t a = 0; a < 3; ++a) {
    dense[a] = kShares[a] * std::abs(dot(point.axes[a], g));
    total += dense[a] * dense[a];
  }
  if (!(total > 0)) return {};
  const double r = point.ring.r;
  return dense[axis] / total * point.ring.profile.fall(r, std::max(length(x - point.x), r));
}

}  // namespace glint
