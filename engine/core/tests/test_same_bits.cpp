// The same bits for any number of threads of the build, for every instruction set and for every
// kind of tree.
#include <cstdlib>
#include <cstring>

#include "check.h"
#include "kernels.h"
#include "shapes.h"

using namespace glint;
using namespace glint::test;

namespace {

/// One of everything: baked and shared meshes, coincident faces, spheres, polygons.
struct Everything : MixedShapes {
  Random random{50};
  Mesh bumpy = bumpy_sphere(150, rounds(200, 70)), small = icosphere(2, 0.2, {}),
       twice = soup(random, 2000, 1.5, 0.05);

  Everything() {
    for (int k = 0; k < 3000; ++k)
      bumpy.add(bumpy.triangles[0], bumpy.triangles[4], bumpy.triangles[8]);
    for (const Mesh* mesh : {&bumpy, &small, &twice, &twice}) add(*mesh);
    add_round_and_square(random, 500, 0.05);
    add_shapes();
    for (uint32_t g : {0u, 2u, 3u, 4u, 5u, 5u})
      place(g, g == 5 ? random_affine(random, 1) : Affine{});
    for (int k = 0; k < 200; ++k) place(1, random_affine(random, 3));
  }
};

std::vector<unsigned char> answers(const Accel& accel) {
  Random random(51);
  std::vector<Ray> rays;
  for (int k = 0; k < rounds(40000); ++k)
    rays.push_back(ray(random.in_box(4), random.on_sphere(), 0, k % 5 ? HUGE_VAL : 2));
  std::vector<Hit> hits(rays.size());
  std::vector<uint8_t> blocked(rays.size());
  accel.closest(rays.data(), hits.data(), rays.size());
  accel.occluded(rays.data(), blocked.data(), rays.size());
  std::vector<unsigned char> bytes(sizeof(Hit) * hits.size());
  std::memcpy(bytes.data(), hits.data(), bytes.size());
  bytes.insert(bytes.end(), blocked.begin(), blocked.end());
  return bytes;
}

/// The same, with what the tree is.
std::vector<unsigned char> answers(const Everything& scene, int threads,
                                   BuildQuality quality = BuildQuality::kBalanced) {
  const auto accel = build(scene.geometries, scene.instances, threads, quality);
  std::vector<unsigned char> bytes = answers(*accel);
  const AccelStats s = accel->stats();
  for (size_t n : {s.nodes, s.bytes, s.primitives, s.dropped})
    for (int k = 0; k < 64; k += 8) bytes.push_back(static_cast<unsigned char>(n >> k));
  return bytes;
}

/// Numbers as the sum of two floats, as kernels keep the origins of rays.
struct Split {
  float coarse[3], rest[3];
};
__attribute__((noinline)) Split split(const double (&numbers)[3]) {
  Split s;
  for (int k = 0; k < 3; ++k) {
    s.coarse[k] = float(numbers[k]);
    s.rest[k] = float(numbers[k] - double(s.coarse[k]));
  }
  return s;
}

}  // namespace

TEST(same_bits, the_compiler_rounds_what_is_to_be_rounded) {
  const Split s = split({1.0 / 3, 0.1, 0.7});
  const double rest[3] = {0x1.5555555555555p-2 - 0x1.555556p-2,
                          0x1.999999999999ap-4 - 0x1.99999ap-4,
                          0x1.6666666666666p-1 - 0x1.666666p-1};
  for (int k = 0; k < 3; ++k) CHECK(s.rest[k] == float(rest[k]) && rest[k] != 0);
}

TEST(same_bits, any_number_of_threads) {
  const Everything scene;
  for (BuildQuality quality : kQualities) {
    const auto one = answers(scene, 1, quality);
    for (int threads : {2, 5}) CHECK(answers(scene, threads, quality) == one);
  }
}

TEST(same_bits, any_tree) {
  const Everything scene;
  const auto balanced = build(scene.geometries, scene.instances);
  for (BuildQuality quality : kQualities) {
    const auto other = build(scene.geometries, scene.instances, 2, quality);
    CHECK(answers(*other) == answers(*balanced));
    if (quality != BuildQuality::kBalanced) CHECK(other->stats().nodes != balanced->stats().nodes);
  }
}

TEST(same_bits, any_instruction_set) {
  const Everything scene;
  const auto best = answers(scene, 2);
  for (const std::string& isa : kernels_here()) {
    ask_for_isa(isa.c_str());
    CHECK(answers(scene, 2) == best);
    ask_for_isa(nullptr);
  }
}
