// Accelerators that take trees over from the one before: the bits of a build without it, or the
// same surfaces.
#include <cmath>

#include "brute.h"
#include "check.h"
#include "shapes.h"

using namespace glint;
using namespace glint::test;

namespace {

constexpr uint32_t kSeen = kCamera | kMirror | kShadow;

/// Six meshes that stand once and one that stands three times.
struct Stage {
  std::vector<Mesh> meshes;
  BruteScene scene;
  explicit Stage(Random& random) {
    for (int k = 0; k < 7; ++k) meshes.push_back(icosphere(1, 0.5, {0.1 * k, 0, 0}));
    for (uint32_t k = 0; k < 9; ++k)
      scene.instances.push_back({std::min(k, 6u), kSeen, random_affine(random, 3)});
    see();
  }
  void see() {
    scene.geometries.clear();
    for (const Mesh& m : meshes) scene.geometries.push_back(m.view());
  }
  std::shared_ptr<const Accel> build(const AccelBase& base = {}) const {
    const std::atomic<bool> never{false};
    return Accel::build(scene.geometries, scene.instances, 2, never, BuildQuality::kBalanced, base);
  }
  AccelBase base(std::shared_ptr<const Accel> accel, bool exact) const {
    return {std::move(accel), {0, 1, 2, 3, 4, 5, 6}, true, exact};
  }
};

std::vector<Ray> rays_through(Random& random, int count) {
  std::vector<Ray> rays;
  for (int k = 0; k < count; ++k) {
    const Vec3d o = 8.0 * random.on_sphere();
    rays.push_back(ray(o, random.in_box(3) - o));
  }
  return rays;
}

bool same_bits(const Hit& a, const Hit& b) {
  return a.t == b.t && a.instance == b.instance && a.primitive == b.primitive && a.u == b.u &&
         a.v == b.v;
}

}  // namespace

TEST(reuse, exactly_as_without) {
  Random random(70);
  Stage stage(random);
  std::shared_ptr<const Accel> accel = stage.build();
  for (int round = 0; round < 20; ++round) {
    stage.scene.instances[random.below(9)].world_from_object = random_affine(random, 3);
    accel = stage.build(stage.base(accel, true));
    CHECK(accel->validate().empty());
    const auto fresh = stage.build();
    for (const Ray& r : rays_through(random, 300))
      CHECK(same_bits(closest(*accel, r), closest(*fresh, r)));
  }
}

TEST(reuse, the_same_surfaces_after_moves_and_edits) {
  Random random(71);
  Stage stage(random);
  std::shared_ptr<const Accel> accel = stage.build();
  const size_t each = stage.meshes[0].count();
  for (int round = 0; round < 20; ++round) {
    AccelBase base = stage.base(accel, false);
    const size_t k = random.below(9), edited = random.below(7);
    stage.scene.instances[k].world_from_object = random_affine(random, 3);
    if (round % 4 == 3) {
      stage.meshes[edited] = icosphere(1, random.uniform(0.2, 1), {});
      stage.see();
      base.geometry[edited] = AccelBase::kNone;
    }
    accel = stage.build(base);
    CHECK(accel->validate().empty());
    CHECK(accel->stats().built <= 2 * each);
    for (const Ray& r : rays_through(random, 300)) {
      uint8_t blocked;
      accel->occluded(&r, &blocked, 1);
      const std::vector<Truth> truth = brute(stage.scene, r);
      CHECK(agrees(truth, closest(*accel, r)) && agrees(truth, blocked != 0));
    }
  }
}

// Shared trees in object space are never made anew; those in world space only where something in
// them changed.
TEST(reuse, builds_what_changed) {
  Random random(72);
  Stage stage(random);
  const size_t each = stage.meshes[0].count();
  std::shared_ptr<const Accel> first = stage.build();
  CHECK(first->stats().built == 7 * each);
  stage.scene.instances[7].world_from_object = random_affine(random, 3);
  CHECK(stage.build(stage.base(first, true))->stats().built == 0);
  stage.scene.instances[2].world_from_object = random_affine(random, 3);
  CHECK(stage.build(stage.base(first, true))->stats().built == 6 * each);
  CHECK(stage.build(stage.base(first, false))->stats().built == each);
  AccelBase elsewhere = stage.base(first, false);
  elsewhere.same_space = false;
  CHECK(stage.build(elsewhere)->stats().built == 6 * each);
}

// A few instances that move stand beside the tree over all of them; when they are more it is made
// anew.
TEST(reuse, instances_beside_their_tree) {
  Random random(73);
  Stage stage(random);
  for (int k = 0; k < 30; ++k)
    stage.scene.instances.push_back({6, kSeen, random_affine(random, 3)});
  std::shared_ptr<const Accel> accel = stage.build();
  const size_t nodes = accel->stats().nodes;
  bool was_made_anew = false;
  for (uint32_t round = 0; round < 12; ++round) {
    const uint32_t moved = 10 + (round < 4 ? round / 2 : round);
    stage.scene.instances[moved].world_from_object = random_affine(random, 3);
    stage.scene.instances[9].visibility = round % 2 ? kSeen : kShadow;
    accel = stage.build(stage.base(accel, false));
    CHECK(accel->validate().empty());
    if (round < 6) CHECK(accel->stats().nodes == nodes + 1);
    was_made_anew = was_made_anew || accel->stats().nodes != nodes + 1;
    for (const Ray& r : rays_through(random, 100)) {
      uint8_t blocked;
      accel->occluded(&r, &blocked, 1);
      const std::vector<Truth> truth = brute(stage.scene, r);
      CHECK(agrees(truth, closest(*accel, r)) && agrees(truth, blocked != 0));
    }
  }
  CHECK(was_made_anew);
}
