#include "bvh/reuse/reuse.h"

#include <algorithm>
#include <cstring>

namespace glint {
namespace {

constexpr size_t kFew = 16;             // instances that may always move out; of more, only half
constexpr size_t kBeside = kWidth - 1;  // instances beside the tree over them

bool same(const Affine& a, const Affine& b) { return std::memcmp(&a, &b, sizeof(Affine)) == 0; }

}  // namespace

BvhReuse::BvhReuse(const AccelBase& base, const std::vector<InstanceView>& instances)
    : world_(static_cast<const TopLevelBvh*>(base.accel.get())),
      base_(base),
      instances_(instances) {}

std::shared_ptr<const Tree> BvhReuse::object(uint32_t geometry) const {
  return world_ && base_.geometry[geometry] != AccelBase::kNone
             ? world_->object(base_.geometry[geometry])
             : nullptr;
}

/// Whether the k-th instance in a tree is still the same geometry in the same place.
bool BvhReuse::stands(const BakedTree& tree, size_t k) const {
  if (tree.instances[k] >= instances_.size()) return false;
  const InstanceView& now = instances_[tree.instances[k]];
  const uint32_t there = base_.geometry[now.geometry];
  return there != AccelBase::kNone && there == tree.geometries[k] &&
         same(now.world_from_object, tree.matrices[k]);
}

BakedTree BvhReuse::baked(int kind, const std::vector<uint32_t>& wanted) const {
  if (!world_ || !base_.same_space || world_->baked(kind).instances != wanted) return {};
  const BakedTree& tree = world_->baked(kind);
  for (size_t k = 0; k < wanted.size(); ++k)
    if (!stands(tree, k)) return {};
  return all(kind);
}

BakedTree BvhReuse::all(int kind) const {
  BakedTree tree = world_->baked(kind);
  std::vector<uint32_t> now;
  for (uint32_t g = 0; g < base_.geometry.size(); ++g) {
    const uint32_t before = base_.geometry[g];
    if (before == AccelBase::kNone) continue;
    if (before >= now.size()) now.resize(before + 1, AccelBase::kNone);
    now[before] = g;
  }
  for (uint32_t& g : tree.geometries) g = g < now.size() ? now[g] : AccelBase::kNone;
  return tree;
}

bool BvhReuse::moved(const std::vector<uint32_t>& placed, std::vector<uint32_t>& moved) const {
  if (!world_ || !base_.same_space || base_.exact || world_->placed().instances != placed)
    return false;
  moved = world_->placed().moved;
  for (uint32_t i : placed) {
    const InstanceView &now = instances_[i], &then = world_->instance(i);
    if (base_.geometry[now.geometry] != then.geometry) return false;
    if (now.visibility == then.visibility && same(now.world_from_object, then.world_from_object))
      continue;
    if (std::find(moved.begin(), moved.end(), i) == moved.end()) moved.push_back(i);
    if (moved.size() > kBeside) return false;
  }
  return true;
}

bool BvhReuse::move_out(Plan& plan, const std::vector<GeometryView>& geometries) const {
  if (!world_ || !base_.same_space || base_.exact) return false;
  std::vector<uint8_t> stays(instances_.size(), 0);
  for (int kind = 0; kind < 3; ++kind) {
    const BakedTree& tree = world_->baked(kind);
    for (size_t k = 0; k < tree.instances.size(); ++k)
      if (stands(tree, k)) stays[tree.instances[k]] = 1;
  }
  Plan out;
  out.placed = plan.placed;
  out.dropped = plan.dropped;
  size_t count = 0, left = 0, primitives = 0, unknown = 0;
  for (int kind = 0; kind < 3; ++kind)
    for (uint32_t i : plan.baked[kind]) {
      const uint32_t geometry = instances_[i].geometry;
      const size_t size = geometries[geometry].primitive_count;
      ++count;
      primitives += size;
      if (stays[i]) {
        out.baked[kind].push_back(i);
        continue;
      }
      if (!invertible(instances_[i].world_from_object)) return false;
      ++left;
      unknown += base_.geometry[geometry] == AccelBase::kNone ? size : 0;
      out.placed.push_back(i);
    }
  if (left > std::max(kFew, count / 2) || unknown > primitives / 2) return false;
  plan = std::move(out);
  return true;
}

}  // namespace glint
