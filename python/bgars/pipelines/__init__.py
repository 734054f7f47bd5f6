"""What joins the stages: each public function that needs more than one of them."""
