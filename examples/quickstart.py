import bgars

capture = bgars.read_capture(bgars.sample_capture())  # or the folder of your own photographs
field = bgars.estimate_normals(capture)  # unit normals, albedo, confidence, mask
height = bgars.integrate_normals(field)  # height map, zero mean in each connected part
mesh = bgars.mesh_from_height(height, field)  # a trimesh.Trimesh
bgars.write_mesh(mesh, "ball.ply")

errors = bgars.evaluate(capture).normals  # this sample brings its truth
print(f"{field.mask.sum()} normals, mean error {errors.mean_deg:.2f} deg, height in {height.unit}")
