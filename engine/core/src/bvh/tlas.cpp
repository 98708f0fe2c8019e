#include "bvh/tlas.h"

#include <algorithm>
#include <chrono>

#include "bvh/outline.h"
#include "bvh/reuse/reuse.h"
#include "bvh/traverse/empty_tile_culling.h"

namespace glint {
namespace {

constexpr uint32_t kNoTree = 0xffffffffu;
constexpr double kTiny = 0x1p-12;  // of the largest coordinate
constexpr size_t kFew = 32;        // triangles: fewer are tested soon enough
constexpr size_t kSmall = 65536;   // primitives: below, object trees are built one a thread

/// The common factor of a matrix that only rotates, mirrors and scales evenly; 0 for any other.
/// Spheres stay spheres to float precision.
double similarity(const Affine& m) {
  const double x = length(m.x), y = length(m.y), z = length(m.z), tolerance = 1e-8 * x;
  const bool even = std::fabs(x - y) <= tolerance && std::fabs(x - z) <= tolerance;
  const bool square = std::fabs(dot(m.x, m.y)) <= tolerance * x &&
                      std::fabs(dot(m.y, m.z)) <= tolerance * x &&
                      std::fabs(dot(m.z, m.x)) <= tolerance * x;
  return even && square ? x : 0;
}

std::vector<uint32_t> count_uses(const std::vector<GeometryView>& geometries,
                                 const std::vector<InstanceView>& instances) {
  std::vector<uint32_t> uses(geometries.size(), 0);
  for (const InstanceView& i : instances) uses[i.geometry] += finite(i.world_from_object);
  return uses;
}

/// The factor by which an instance scales the radii of its spheres; 1 for other shapes. 0 for
/// strands, which stay in object space: their trees are not copied for each placement.
double radius_scale(const GeometryView& g, const Affine& m) {
  if (g.kind == GeometryView::kStrands) return 0;
  return g.kind == GeometryView::kSpheres ? similarity(m) : 1;
}

/// How large a mesh is in world space, and its largest coordinate there; of its box, turned.
struct Extent {
  double size, largest;
  Extent(const GeometryView& g, const Affine& m) : size(0), largest(0) {
    BoxD object, world;
    for (size_t k = 0; k < g.vertex_count; ++k) {
      const float* v = g.vertices + 3 * k;
      const Vec3d p = {v[0], v[1], v[2]};
      if (finite(p)) object.add(p);
    }
    if (!(object.lo.x <= object.hi.x)) return;
    for (int k = 0; k < 8; ++k)
      world.add(point(m, {k & 1 ? object.hi.x : object.lo.x, k & 2 ? object.hi.y : object.lo.y,
                          k & 4 ? object.hi.z : object.lo.z}));
    size = max_abs(world.hi - world.lo);
    largest = std::max(max_abs(world.lo), max_abs(world.hi));
  }
};

/// Rays meet the boxes of a tree as if these were wider by rounding of its largest coordinates, and
/// so all triangles of meshes that are no larger than that: these get trees of their own.
void move_tiny_out(Plan& p, const std::vector<GeometryView>& geometries,
                   const std::vector<InstanceView>& instances) {
  std::vector<uint32_t>& meshes = p.baked[GeometryView::kMesh];
  if (meshes.size() < 2) return;
  std::vector<Extent> extents;
  double largest = 0;
  for (uint32_t i : meshes) {
    extents.emplace_back(geometries[instances[i].geometry], instances[i].world_from_object);
    largest = std::max(largest, extents.back().largest);
  }
  std::vector<uint32_t> kept;
  for (size_t k = 0; k < meshes.size(); ++k) {
    const uint32_t i = meshes[k];
    const bool tiny = extents[k].size < kTiny * largest &&
                      geometries[instances[i].geometry].primitive_count >= kFew &&
                      invertible(instances[i].world_from_object);
    (tiny ? p.placed : kept).push_back(i);
  }
  if (kept.size() == meshes.size()) return;
  meshes = std::move(kept);
  std::sort(p.placed.begin(), p.placed.end());
}

}  // namespace

bool invertible(const Affine& m) {
  Affine unused;
  return inverse(m, unused);
}

bool inverse(const Affine& m, Affine& linear) {
  const double ix = 1 / length(m.x), iy = 1 / length(m.y), iz = 1 / length(m.z);
  const Vec3d x = ix * m.x, y = iy * m.y, z = iz * m.z;
  const double det = dot(x, cross(y, z));
  if (!(std::fabs(det) > 1e-8)) return false;  // NaN for a column of length 0
  const Vec3d a = (ix / det) * cross(y, z), b = (iy / det) * cross(z, x),
              c = (iz / det) * cross(x, y);  // rows
  linear = {{a.x, b.x, c.x}, {a.y, b.y, c.y}, {a.z, b.z, c.z}, {}};
  return finite(linear);
}

std::unique_ptr<Accel> Accel::build(std::vector<GeometryView> geometries,
                                    std::vector<InstanceView> instances, int threads,
                                    const std::atomic<bool>& cancel, BuildQuality quality,
                                    const AccelBase& base) {
  try {
    return std::make_unique<TopLevelBvh>(std::move(geometries), std::move(instances), threads,
                                         cancel, quality, base);
  } catch (const Cancelled&) {
    return nullptr;
  }
}

TopLevelBvh::TopLevelBvh(std::vector<GeometryView> geometries, std::vector<InstanceView> instances,
                         int threads, const std::atomic<bool>& cancel, BuildQuality quality,
                         const AccelBase& base)
    : kernel_(best_kernel()),
      quality_(quality),
      geometries_(std::move(geometries)),
      instances_(std::move(instances)) {
  const auto start = std::chrono::steady_clock::now();
  if (cancel.load()) throw Cancelled{};
  ThreadPool pool(threads);
  const BvhReuse before(base, instances_);
  Plan p = plan();
  const bool moved = before.move_out(p, geometries_);
  for (int kind = 0; kind < 3; ++kind) {
    baked_[kind] = moved ? before.all(kind) : before.baked(kind, p.baked[kind]);
    if (!baked_[kind].tree) {
      baked_[kind] = bake(p.baked[kind], pool, cancel);
      stats_.built += baked_[kind].tree->count;
    }
  }
  build_objects(p.placed, before, pool, cancel);
  build_instances(p.placed, before, pool, cancel);
  hide_moved(p);
  make_view();
  count(p);
  stats_.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::shared_ptr<const Tree> TopLevelBvh::object(uint32_t geometry) const {
  return object_of_[geometry] != kNoTree ? objects_[object_of_[geometry]] : nullptr;
}

Plan TopLevelBvh::plan() const {
  Plan p;
  const std::vector<uint32_t> uses = count_uses(geometries_, instances_);
  for (uint32_t i = 0; i < instances_.size(); ++i) {
    const Affine& m = instances_[i].world_from_object;
    const GeometryView& g = geometries_[instances_[i].geometry];
    const bool once = uses[instances_[i].geometry] == 1;
    const double scale = radius_scale(g, m);
    if (!finite(m)) {
      p.dropped += g.primitive_count;
    } else if (invertible(m) && (!once || scale == 0)) {
      p.placed.push_back(i);
    } else if (scale == 0) {
      p.dropped += g.primitive_count;  // flattened spheres and strands
    } else {
      p.baked[g.kind].push_back(i);
    }
  }
  move_tiny_out(p, geometries_, instances_);
  return p;
}

BakedTree TopLevelBvh::bake(const std::vector<uint32_t>& wanted, ThreadPool& pool,
                            const std::atomic<bool>& cancel) const {
  BakedTree baked;
  std::vector<Source> sources;
  for (uint32_t i : wanted) {
    const InstanceView& v = instances_[i];
    const GeometryView& g = geometries_[v.geometry];
    sources.push_back(
        {&g, i, &v.world_from_object, radius_scale(g, v.world_from_object), nullptr, {}});
    baked.instances.push_back(i);
    baked.geometries.push_back(v.geometry);
    baked.matrices.push_back(v.world_from_object);
  }
  baked.tree = std::make_shared<const Tree>(make_tree(sources, quality_, pool, cancel));
  return baked;
}

void TopLevelBvh::build_objects(const std::vector<uint32_t>& placed, const BvhReuse& before,
                                ThreadPool& pool, const std::atomic<bool>& cancel) {
  object_of_.assign(geometries_.size(), kNoTree);
  std::vector<uint32_t> used, small;
  for (uint32_t i : placed) {
    uint32_t& object = object_of_[instances_[i].geometry];
    if (object != kNoTree) continue;
    object = uint32_t(used.size());
    used.push_back(instances_[i].geometry);
  }
  objects_.resize(used.size());
  auto build = [&](uint32_t object, ThreadPool& with) {
    std::vector<Source> sources;
    sources.push_back({&geometries_[used[object]], 0, nullptr, 1, nullptr, {}});
    objects_[object] = std::make_shared<const Tree>(make_tree(sources, quality_, with, cancel));
  };
  for (uint32_t k = 0; k < used.size(); ++k) {
    objects_[k] = before.object(used[k]);
    if (objects_[k]) continue;
    stats_.built += geometries_[used[k]].primitive_count;
    if (geometries_[used[k]].primitive_count >= kSmall) build(k, pool);
    else small.push_back(k);
  }
  pool.run(small.size(), [&](size_t k) {
    ThreadPool alone(1);
    build(small[k], alone);
  });
}

InstanceRecord TopLevelBvh::record_of(uint32_t instance) const {
  const Affine& m = instances_[instance].world_from_object;
  Affine n;
  inverse(m, n);
  return {{n.x.x, n.x.y, n.x.z, n.y.x, n.y.y, n.y.z, n.z.x, n.z.y, n.z.z},
          {m.t.x, m.t.y, m.t.z},
          object_of_[instances_[instance].geometry],
          instance,
          instances_[instance].visibility};
}

void TopLevelBvh::build_instances(const std::vector<uint32_t>& placed, const BvhReuse& before,
                                  ThreadPool& pool, const std::atomic<bool>& cancel) {
  placed_.instances = placed;
  if (before.moved(placed, placed_.moved)) return keep_instances(before.placed());
  placed_.moved.clear();
  std::vector<uint32_t> seen;
  for (uint32_t i : placed)
    if (object_at(i).count > 0) seen.push_back(i);
  std::vector<Ref> boxes(seen.size());
  each_chunk(seen.size(), 256, pool, [&](size_t k) {
    boxes[k] =
        make_ref(world_box(object_at(seen[k]), instances_[seen[k]].world_from_object), seen[k], 0);
  });
  placed_.built = placed_.tree =
      std::make_shared<const Tree>(make_instance_tree(std::move(boxes), pool, cancel));
  for (uint32_t i : placed_.tree->order) placed_.records.push_back(record_of(i));
}

/// Takes over the tree over instances, with those that moved since beside it.
void TopLevelBvh::keep_instances(const PlacedTree& there) {
  const std::vector<uint32_t>& moved = placed_.moved;
  placed_.built = there.built;
  placed_.records.assign(there.records.begin(),
                         there.records.begin() + ptrdiff_t(there.built->count));
  for (InstanceRecord& r : placed_.records) {
    r.tree = object_of_[instances_[r.instance].geometry];
    if (std::find(moved.begin(), moved.end(), r.instance) != moved.end()) r.visibility = 0;
  }
  std::vector<Ref> beside;
  for (uint32_t i : moved) {
    const Tree& object = object_at(i);
    if (object.count == 0) continue;
    beside.push_back(make_ref(world_box(object, instances_[i].world_from_object), i, 0));
    placed_.records.push_back(record_of(i));
  }
  placed_.tree = beside.empty() ? placed_.built
                                : std::make_shared<const Tree>(with_beside(*placed_.built, beside));
}

/// What the world's trees hold and the plan has elsewhere, or nowhere, is not seen there.
void TopLevelBvh::hide_moved(const Plan& plan) {
  visibility_.reserve(instances_.size());
  for (const InstanceView& i : instances_) visibility_.push_back(i.visibility);
  std::vector<uint8_t> stays(instances_.size(), 0);
  for (const auto& baked : plan.baked)
    for (uint32_t i : baked) stays[i] = 1;
  for (const BakedTree& baked : baked_)
    for (uint32_t i : baked.instances) {
      if (i >= visibility_.size()) visibility_.resize(i + 1, 0);
      if (i >= stays.size() || !stays[i]) visibility_[i] = 0;
    }
}

void TopLevelBvh::make_view() {
  uint32_t common = ~0u;
  for (uint32_t v : visibility_) common &= v;
  for (const auto* tree : {&baked_[0].tree, &baked_[1].tree, &baked_[2].tree, &placed_.tree})
    if ((*tree)->count > 0) tree_views_.push_back((*tree)->view());
  for (const auto& tree : objects_) object_views_.push_back(tree->view());
  view_ = {tree_views_.data(),     tree_views_.size(), object_views_.data(),
           placed_.records.data(), visibility_.data(), common};
}

bool TopLevelBvh::surely_empty(const TileFrustum& frustum) const {
  return std::all_of(tree_views_.begin(), tree_views_.end(),
                     [&](const TreeView& tree) { return glint::surely_empty(tree, frustum); });
}

void TopLevelBvh::count(const Plan& plan) {
  stats_.dropped = plan.dropped;
  stats_.bytes =
      placed_.records.size() * sizeof(InstanceRecord) + visibility_.size() * sizeof(uint32_t);
  auto add = [&](const Tree& t) {
    stats_.dropped += t.dropped;
    stats_.bytes += t.bytes();
    stats_.nodes += t.nodes.nodes.size;
    if (t.kind != kInstanceLeaf) stats_.primitives += t.primitives;
  };
  for (const BakedTree& baked : baked_) add(*baked.tree);
  for (const auto& tree : objects_) add(*tree);
  add(*placed_.tree);
}

}  // namespace glint
