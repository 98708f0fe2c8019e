// The accelerator behind accel.h.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "bvh/accel.h"
#include "bvh/source.h"
#include "bvh/traverse/kernel.h"

namespace glint {

/// Where instances go: into the world's trees with their vertices, or into the tree over instances
/// with their matrix. By number.
struct Plan {
  std::vector<uint32_t> baked[3];  // meshes, spheres, polygons
  std::vector<uint32_t> placed;
  size_t dropped = 0;  // primitives that can go nowhere
};

/// A tree in world space, and what it was made from.
struct BakedTree {
  std::shared_ptr<const Tree> tree;
  std::vector<uint32_t> instances, geometries;
  std::vector<Affine> matrices;
};

/// The tree over instances. A few that moved since it was built stand beside it.
struct PlacedTree {
  std::shared_ptr<const Tree> built, tree;  // as the builder made it; the same with what moved
  std::vector<InstanceRecord> records;  // in the order of the leaves; hidden in `built` what moved,
                                        // at the end where it is now
  std::vector<uint32_t> instances, moved;  // all there are, and those that moved, by number
};

class BvhReuse;

class TopLevelBvh final : public Accel {
 public:
  TopLevelBvh(std::vector<GeometryView> geometries, std::vector<InstanceView> instances,
              int threads, const std::atomic<bool>& cancel, BuildQuality quality,
              const AccelBase& base);
  void closest(const Rays& rays, const Hits& hits, Scratch& scratch) const override {
    kernel_.closest(view_, rays, hits, scratch.stacks());
  }
  void occluded(const Rays& rays, uint8_t* blocked, Scratch& scratch) const override {
    kernel_.occluded(view_, rays, blocked, nullptr, scratch.stacks());
  }
  void find_layers(const Rays& rays, const Layers& layers, uint8_t* blocked,
                   Scratch& scratch) const override {
    kernel_.occluded(view_, rays, blocked, &layers, scratch.stacks());
  }
  bool surely_empty(const TileFrustum& frustum) const override;
  std::string validate() const override;
  AccelStats stats() const override { return stats_; }
  const BakedTree& baked(int kind) const { return baked_[kind]; }
  /// The tree of a geometry in object space; null where there is none.
  std::shared_ptr<const Tree> object(uint32_t geometry) const;
  const PlacedTree& placed() const { return placed_; }
  const InstanceView& instance(uint32_t number) const { return instances_[number]; }

 private:
  Plan plan() const;
  BakedTree bake(const std::vector<uint32_t>& wanted, ThreadPool& pool,
                 const std::atomic<bool>& cancel) const;
  void hide_moved(const Plan& plan);
  void build_objects(const std::vector<uint32_t>& placed, const BvhReuse& before, ThreadPool& pool,
                     const std::atomic<bool>& cancel);
  const Tree& object_at(uint32_t instance) const {
    return *objects_[object_of_[instances_[instance].geometry]];
  }
  InstanceRecord record_of(uint32_t instance) const;
  void build_instances(const std::vector<uint32_t>& placed, const BvhReuse& before,
                       ThreadPool& pool, const std::atomic<bool>& cancel);
  void keep_instances(const PlacedTree& there);
  void make_view();
  void count(const Plan& plan);

  const Kernel& kernel_;
  const BuildQuality quality_;
  std::vector<GeometryView> geometries_;
  std::vector<InstanceView> instances_;
  BakedTree baked_[3];  // meshes, spheres, polygons
  PlacedTree placed_;
  std::vector<std::shared_ptr<const Tree>> objects_;  // in object space
  std::vector<uint32_t> object_of_;                   // geometry to object tree, or kNoTree
  std::vector<uint32_t> visibility_;  // of instances, where the world's trees have them
  std::vector<TreeView> tree_views_, object_views_;
  TopLevelView view_{};
  AccelStats stats_;
};

/// Whether an instance with this matrix can keep a tree in object space.
bool invertible(const Affine& m);

/// Columns of the inverse of a matrix' linear part; false when it has none worth using (columns of
/// length 0, or parallel to 1e-8).
bool inverse(const Affine& m, Affine& linear);

/// What is wrong with a tree, or "".
std::string tree_problem(const Tree& tree, const std::vector<Box>& primitives);

/// The box of every primitive of a tree, in the order of the leaves.
std::vector<Box> primitive_boxes(const Tree& tree);

}  // namespace glint
