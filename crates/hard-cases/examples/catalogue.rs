//! Prints the catalogue: every case with its size and why it is hard.

fn main() {
    for case in niwaki_hard_cases::meshes() {
        println!("{:22} {:>7} triangles  {}", case.name, case.mesh.len(), case.why);
    }
}
