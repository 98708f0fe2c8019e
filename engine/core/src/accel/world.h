// The accelerator behind accel.h.
#pragma once
#include <string>
#include <vector>

#include "accel.h"
#include "kernel.h"
#include "source.h"

namespace glint {

/// Where an instance goes: its vertices into the world's trees, or its matrix into the tree over instances.
struct Plan {
  std::vector<Source> meshes, spheres, polygons;  // in world space
  std::vector<uint32_t> placed;                   // numbers of instances that keep a tree in object space
  size_t dropped = 0;                             // primitives that can go nowhere
};

class World final : public Accel {
 public:
  World(std::vector<GeometryView> geometries, std::vector<InstanceView> instances, int threads, const std::atomic<bool>& cancel,
        BuildQuality quality);
  void closest(const Rays& rays, const Hits& hits) const override { kernel_.closest(view_, rays, hits); }
  void occluded(const Rays& rays, uint8_t* blocked) const override { kernel_.occluded(view_, rays, blocked); }
  std::string validate() const override;
  AccelStats stats() const override { return stats_; }

 private:
  Plan plan() const;
  void build_objects(const std::vector<uint32_t>& placed, Team& team, const std::atomic<bool>& cancel);
  void build_instances(const std::vector<uint32_t>& placed, Team& team, const std::atomic<bool>& cancel);
  void make_view();
  void count(const Plan& plan);

  const Kernel& kernel_;
  const BuildQuality quality_;
  std::vector<GeometryView> geometries_;
  std::vector<InstanceView> instances_;
  std::vector<Tree> trees_;            // in world space: meshes, spheres, polygons, instances, as far as there are any
  std::vector<Tree> objects_;          // in object space
  std::vector<uint32_t> object_of_;    // geometry to object tree, or kNoTree
  std::vector<InstanceRecord> records_;
  std::vector<uint32_t> visibility_;
  std::vector<TreeView> tree_views_, object_views_;
  WorldView view_{};
  AccelStats stats_;
};

/// Columns of the inverse of a matrix' linear part; false when it has none worth using (columns of length 0, or parallel to 1e-8).
bool inverse(const Affine& m, Affine& linear);

/// What is wrong with a tree, or "".
std::string tree_problem(const Tree& tree, const std::vector<Box>& primitives);

/// The box of every primitive of a tree, in the order of the leaves.
std::vector<Box> primitive_boxes(const Tree& tree);

/// A box in world space round a box in object space; NaN-free for finite matrices.
BoxD world_box(const Box& box, const Affine& m);

}  // namespace glint
