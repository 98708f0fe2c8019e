// What a new world takes over from an earlier one: trees of what has not changed.
#pragma once
#include <memory>
#include <vector>

#include "bvh/tlas.h"

namespace glint {

class BvhReuse {
 public:
  /// `instances` of the new world, and where each stands.
  BvhReuse(const AccelBase& base, const std::vector<InstanceView>& instances);

  /// The tree of a geometry in object space; null where there is none yet.
  std::shared_ptr<const Tree> object(uint32_t geometry) const;
  /// The world's tree of a kind if it holds just these instances; else one without a tree.
  BakedTree baked(int kind, const std::vector<uint32_t>& wanted) const;
  /// Has what moved or changed leave the world's trees for trees of its own, so that those can be
  /// taken over as they are, with the rest hidden. False, with `plan` as it was, where that does
  /// not serve: other coordinates, too much that is new, or a matrix without an inverse.
  bool move_out(Plan& plan, const std::vector<GeometryView>& geometries) const;
  /// Whether the tree over just these instances may stay, with `moved` beside it: that many as a
  /// node has room for.
  bool moved(const std::vector<uint32_t>& placed, std::vector<uint32_t>& moved) const;
  const PlacedTree& placed() const { return world_->placed(); }
  /// The world's tree of a kind, in the numbers of the new world.
  BakedTree all(int kind) const;

 private:
  bool stands(const BakedTree& tree, size_t k) const;

  const TopLevelBvh* world_;
  const AccelBase& base_;
  const std::vector<InstanceView>& instances_;
};

}  // namespace glint
