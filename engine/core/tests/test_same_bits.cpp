// The same bits for any number of threads of the build and for every instruction set.
#include <cstdlib>
#include <cstring>

#include "check.h"
#include "shapes.h"

using namespace glint;
using namespace glint::test;

namespace {

/// One of everything: baked and shared meshes, coincident faces, spheres, polygons.
struct Everything : MixedShapes {
  Random random{50};
  Mesh bumpy = bumpy_sphere(150, 200), small = icosphere(2, 0.2, {}), twice = soup(random, 2000, 1.5, 0.05);

  Everything() {
    for (int k = 0; k < 3000; ++k) bumpy.add(bumpy.triangles[0], bumpy.triangles[4], bumpy.triangles[8]);
    for (const Mesh* mesh : {&bumpy, &small, &twice, &twice}) add(*mesh);
    add_round_and_square(random, 500, 0.05), add_shapes();
    for (uint32_t g : {0u, 2u, 3u, 4u, 5u, 5u}) place(g, g == 5 ? random_affine(random, 1) : Affine{});
    for (int k = 0; k < 200; ++k) place(1, random_affine(random, 3));
  }
};

std::vector<unsigned char> answers(const Everything& scene, int threads) {
  const auto accel = build(scene.geometries, scene.instances, threads);
  Random random(51);
  std::vector<Ray> rays;
  for (int k = 0; k < 40000; ++k) rays.push_back(ray(random.in_box(4), random.on_sphere(), 0, k % 5 ? HUGE_VAL : 2));
  std::vector<Hit> hits(rays.size());
  std::vector<uint8_t> blocked(rays.size());
  accel->closest(rays.data(), hits.data(), rays.size());
  accel->occluded(rays.data(), blocked.data(), rays.size());
  std::vector<unsigned char> bytes(sizeof(Hit) * hits.size());
  std::memcpy(bytes.data(), hits.data(), bytes.size());
  bytes.insert(bytes.end(), blocked.begin(), blocked.end());
  const AccelStats s = accel->stats();
  for (size_t n : {s.nodes, s.bytes, s.primitives, s.dropped})
    for (int k = 0; k < 64; k += 8) bytes.push_back(static_cast<unsigned char>(n >> k));
  return bytes;
}

}  // namespace

TEST(same_bits, any_number_of_threads) {
  const Everything scene;
  const auto one = answers(scene, 1);
  for (int threads : {0, 2, 5}) CHECK(answers(scene, threads) == one);
}

TEST(same_bits, any_instruction_set) {
  const Everything scene;
  const auto best = answers(scene, 2);
  for (const char* isa : {"sse42", "avx2", "avx512"}) {
    setenv("GLINT_ISA", isa, 1);
    CHECK(answers(scene, 2) == best);
    unsetenv("GLINT_ISA");
  }
}
